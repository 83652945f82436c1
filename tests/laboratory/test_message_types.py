"""The types that the page is checked by are those of the messages."""

from tools.message_types import FILE, declarations


def test_the_types_of_the_page_are_up_to_date():
    assert FILE.read_text() == declarations(), "run python tools/message_types.py"
