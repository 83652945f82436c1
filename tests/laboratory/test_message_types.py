"""The types that the page is checked by are those of the messages."""

from tools.message_types import FILE, declarations


def test_the_types_of_the_page_are_up_to_date():
    assert FILE.read_text() == declarations(), "run python tools/message_types.py"


def test_what_is_sent_may_leave_out_defaults_and_what_is_received_is_complete():
    text = declarations()
    sent = text.split("export interface AskRun {")[1].split("}")[0]
    received = text.split("export interface Refused {")[1].split("}")[0]
    assert "stepper: string;" in sent
    assert "version?: string | null;" in sent
    assert "line: number | null;" in received
