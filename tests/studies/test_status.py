"""A row's marks are types; their text, which saved results and stores hold, reads back as the same marks."""

import pytest

from hevopt.studies.status import OK, Mark, Status
from hevopt.sweeps.plan.prune import follows

# What tables, JSON, saved results and stores hold: a change of these makes older files unreadable.
TEXTS = {
    "ok": OK,
    "not neutral": Status(Mark.NOT_NEUTRAL),
    "end charge missed": Status(Mark.CHARGE_MISSED),
    "end charge above": Status(Mark.CHARGE_ABOVE),
    "shortfall at 1 step": Status(shortfall_steps=1),
    "shortfall at 12 steps": Status(shortfall_steps=12),
    "not neutral, shortfall at 2 steps": Status(Mark.NOT_NEUTRAL, 2),
    "end charge missed, shortfall at 1 step": Status(Mark.CHARGE_MISSED, 1),
    "failed: no plan": Status(failure="no plan"),
    "failed: shortfall at 3 steps, not neutral": Status(
        failure="shortfall at 3 steps, not neutral"
    ),
}


@pytest.mark.parametrize("text", TEXTS)
def test_text_and_marks_stand_for_each_other(text):
    assert str(TEXTS[text]) == text and Status.read(text) == TEXTS[text]
    assert TEXTS[text].ok == (text == "ok")


def test_earlier_versions_did_not_say_at_how_many_steps():
    assert Status.read("shortfall") == Status(shortfall_steps=1)


@pytest.mark.parametrize("text", ["", "Ok", "failed", "shortfall at 0 steps", "shortfall at ٣ steps", "=1+1",
                                  "not neutral, end charge missed", "shortfall at 2 steps, later"])  # fmt: skip
def test_marks_of_other_versions_are_kept_and_never_ok(text):
    found = Status.read(text)
    assert str(found) == text and found.others and not found.ok


@pytest.mark.parametrize("value", [None, 3, ["ok"], OK])
def test_what_is_no_text_is_no_status(value):
    with pytest.raises(ValueError, match="not the status"):
        Status.read(value)


def test_what_follows_its_cycles_is_told_by_steps_and_not_by_a_word():
    assert follows([None, {"status": "ok"}, {"status": "failed: shortfall"}])
    assert not follows([{"status": "ok"}, {"status": "not neutral, shortfall at 1 step"}])
