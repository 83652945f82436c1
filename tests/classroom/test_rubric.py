"""How many points for which checks, and which rubrics are refused."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from ropeode.classroom import OF_FILES, OF_STEPPERS, Item, read_rubric
from ropeode.errors import InputError

PAGE = Path(__file__).parents[2] / "docs/howto/classroom.md"


ITEM = '[[item]]\nname = "a"\npoints = 1\n'


def rubric(tmp_path, text, checks=OF_STEPPERS):
    path = tmp_path / "rubric.toml"
    path.write_text(text)
    return read_rubric(path, checks)


@pytest.mark.parametrize(
    ("checks", "points"), [(OF_STEPPERS, [2.0, 4.0, 2.0, 2.0]), (OF_FILES, [2.0, 6.0, 2.0])]
)
def test_the_default_gives_ten_points_and_is_documented(tmp_path, checks, points):
    items = read_rubric(None, checks)
    assert items[-1].checks == checks
    documented = re.findall(r"(?s)```toml\n(\[\[item\]\].*?)```", PAGE.read_text())
    assert items == rubric(tmp_path, documented[(OF_STEPPERS, OF_FILES).index(checks)], checks)
    all_right = dict.fromkeys(checks, "pass")
    assert [item.earned(all_right) for item in items] == points


@pytest.mark.parametrize(
    ("statuses", "whole", "in_part"),
    [
        ("pass pass", 4.0, 4.0),
        ("pass fail", 0.0, 2.0),
        ("pass undetermined", 0.0, 2.0),
        ("pass skip", 4.0, 4.0),
        ("pass note", 4.0, 4.0),
        # A check that was not made does not count.
        ("pass", 4.0, 4.0),
        ("skip note", 0.0, 0.0),
    ],
)
def test_points_of_an_item(statuses, whole, in_part):
    for partial, points in ((False, whole), (True, in_part)):
        item = Item("two", 4.0, ("pins", "momentum"), partial)
        assert item.earned(dict(zip(item.checks, statuses.split(), strict=False))) == points


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "rubric: item: nothing given"),
        ("[[item]\n", "a TOML file"),
        (ITEM + '[[item]]\nname = "b"\npoints = -1\n', "rubric: item[2].points: -1.0 given"),
        ('[[item]]\npoints = inf\nname = "a"\n', "item[1].points: inf given"),
        ("[[item]]\npoints = 1\n", "rubric: item[1].name: nothing given"),
        # It is a check of files.
        (ITEM + 'checks = ["initial-state"]\n', "item[1].checks: 'initial-state' given"),
        (ITEM + "partial = 1\n", "item[1].partial: 1 given"),
        (ITEM + "weight = 1\n", "item[1].field: 'weight' given"),
        (ITEM + ITEM, "rubric: item[2].name: 'a' given; allowed: a name of its own"),
        ("total = 10\n" + ITEM, "field of the rubric: 'total' given"),
        # All faults are told at once.
        ('[[item]]\nname = ""\npoints = -1\nchecks = []\n', "item[1].checks: [] given"),
    ],
)
def test_a_wrong_rubric_names_the_field(tmp_path, text, says):
    with pytest.raises(InputError, match=re.escape(says)) as refused:
        rubric(tmp_path, text)
    assert all("Fix:" in line for line in refused.value.problems)
    assert len(refused.value.problems) == (3 if 'name = ""' in text else 1)
