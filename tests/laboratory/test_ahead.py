"""What the worker prepares is what the page asks next."""

from __future__ import annotations

from ropeode.laboratory import answers_in, asks_ahead
from ropeode.laboratory.messages import AskRun
from ropeode.laboratory.scenes import lessons
from tools.default_recording import FILE


def test_the_next_press_of_the_key_is_prepared_first_and_the_lessons_after_it():
    asked = list(asks_ahead())
    shipped = [ask for ask, _, _ in answers_in(FILE.read_text())]
    runs = [each for each in shipped if isinstance(each, AskRun)]
    last = 2 * max(each.steps_per_frame for each in runs)
    next_press = [each.model_copy(update={"steps_per_frame": last}) for each in runs]
    assert asked[0] in shipped
    assert asked[0].kind == "truth"
    for each in asked[1:4]:
        assert each in next_press
    assert not [each for each in asked[1:4] if each in shipped]
    for lesson in lessons():
        state = lesson["state"]
        for name in state["steppers"]:
            run = {"problem": state["problem"], "stepper": name, "kind": "run"}
            assert AskRun(**run, steps_per_frame=state["ladder"][-1]) in asked
