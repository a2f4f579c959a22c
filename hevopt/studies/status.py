"""What is to be known of a row beside its figures, and the text that stands for it in tables and JSON."""

import re
from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache

_OK = "ok"
_FAILED = "failed: "
_SHORTFALL = re.compile(r"shortfall(?: at ([1-9][0-9]{0,8}) steps?)?")


class Mark(StrEnum):
    """A charge at the end that is not the one asked: off by more than 1 % of the fuel's energy.

    Where another charge than the start's is asked, it says to which side.
    """

    NOT_NEUTRAL = "not neutral"
    CHARGE_MISSED = "end charge missed"
    CHARGE_ABOVE = "end charge above"


@dataclass(frozen=True, slots=True)
class Status:
    """A row's marks, or why it has no figures.

    charge: of its end charge; shortfall_steps: steps driven with less than the cycle asks
    others: marks that this version does not know, of results saved by a later one
    """

    charge: Mark | None = None
    shortfall_steps: int = 0
    others: tuple[str, ...] = ()
    failure: str | None = None

    @property
    def ok(self) -> bool:
        """Whether the row has figures and no mark."""
        return self == OK

    def __str__(self) -> str:
        if self.failure is not None:
            return f"{_FAILED}{self.failure}"
        marks = [] if self.charge is None else [str(self.charge)]
        if self.shortfall_steps:
            marks.append(
                f"shortfall at {self.shortfall_steps} step{'s' if self.shortfall_steps > 1 else ''}"
            )
        return ", ".join([*marks, *self.others]) if self != OK else _OK

    @classmethod
    def read(cls, text: object) -> "Status":
        """The status that a saved text stands for; ValueError for what is no text."""
        if not isinstance(text, str):
            raise ValueError("not the status of a row")
        return _read(text)


OK = Status()


@lru_cache(maxsize=1000)
def _read(text: str) -> Status:
    if text == _OK:
        return OK
    if text.startswith(_FAILED):
        return Status(failure=text.removeprefix(_FAILED))
    charge, steps, others = None, 0, []
    for mark in text.split(", "):
        short = _SHORTFALL.fullmatch(mark)
        if charge is None and mark in set(Mark):
            charge = Mark(mark)
        elif short and not steps:
            steps = int(short[1] or 1)  # earlier versions did not say at how many
        else:
            others.append(mark)
    return Status(charge, steps, tuple(others))
