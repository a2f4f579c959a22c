"""The errors hevopt raises on purpose.

    HevoptError            exit status
    ├── DataError          2   an input file, a name or an option is wrong
    │   └── UnknownNoxError 2   NOx is asked of an engine without NOx data
    ├── InfeasibleError    3   nothing can follow the cycle, or keep the charge within its limits
    │   └── EndChargeError 3   nothing reaches the end charge that is asked
    └── SolverError        3   a solver did not return what it promised

Sweeps add WorkersLost, 4: their processes end faster than they work, or do not start.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches


class HevoptError(Exception):
    """Base of all errors raised on purpose."""

    exit_status = 1

    @property
    def headline(self) -> str:
        """The message in one line, without what it lists below."""
        return (str(self).splitlines() or [""])[0].rstrip(":")

    @property
    def listed(self) -> list[str]:
        """What is wrong, one by one, each with its place in front."""
        return [str(self)]


@dataclass(frozen=True, slots=True)
class Fault:
    """One thing that is wrong. place: a file, with the key or line in it; text: what was found, what is allowed and
    what to do."""

    place: str
    text: str

    def __str__(self) -> str:
        return f"{self.place}: {self.text}"


class CoarseTableWarning(UserWarning):
    """A bound may be higher than what a control between those of its table costs."""


class DataError(HevoptError):
    """An input is missing, malformed or not physical: one message, or a message made of faults of one place.

    count: how many faults there are, where not all are given
    """

    exit_status = 2

    def __init__(self, message: str = "", faults: Sequence[Fault] = (), count: int = 0) -> None:
        super().__init__(message, tuple(faults), max(count, len(faults)))

    @classmethod
    def of(cls, place: str, texts: Sequence[str], count: int = 0) -> "DataError":
        """The error that lists faults of a place; count as above."""
        return cls("", [Fault(place, text) for text in texts], count)

    @property
    def faults(self) -> tuple[Fault, ...]:
        """The faults that the message lists; none where it is a message of its own."""
        faults: tuple[Fault, ...] = self.args[1]
        return faults

    @property
    def listed(self) -> list[str]:
        return [*map(str, self.faults), *self._more(f"{self._place}: ")] or [str(self)]

    def __str__(self) -> str:
        message: str = self.args[0]
        faults, count = self.faults, self.args[2]
        if message or not faults:
            return message
        if count == 1:
            return str(faults[0])
        lines = [fault.text for fault in faults]
        return "\n  ".join([f"{self._place}: {count} faults", *lines, *self._more("")])

    @property
    def _place(self) -> str:
        return self.faults[0].place if self.faults else ""

    def _more(self, place: str) -> list[str]:
        left = self.args[2] - len(self.faults)
        return [f"{place}and {left} more"] if left > 0 else []


class UnknownNoxError(DataError):
    """NOx is weighted or cut, and the engine's file has no data on it."""


class InfeasibleError(HevoptError):
    """The problem has no solution, with the first step at which that shows."""

    exit_status = 3


class EndChargeError(InfeasibleError):
    """No plan reaches the end charge that is asked; reachable_soc: the most that any reaches."""

    def __init__(self, message: str, reachable_soc: float) -> None:
        super().__init__(message, reachable_soc)
        self.reachable_soc = reachable_soc

    def __str__(self) -> str:
        return str(self.args[0])


class SolverError(HevoptError):
    """A solver stopped without a usable answer."""

    exit_status = 3


def close_to(
    name: str,
    known: Iterable[str],
    meant: Sequence[str] = (),
    *,
    what: str = "close matches",
    count: int = 3,
    cutoff: float = 0.6,
) -> str:
    """The close matches of a name as the beginning of a hint, or nothing; meant: known ones also called so."""
    close = dict.fromkeys([*get_close_matches(name, list(known), n=count, cutoff=cutoff), *meant])
    return f"{what}: {', '.join(close)}; " if close else ""


def unknown_name(kind: str, name: str, known: list[str], meant: Sequence[str] = ()) -> DataError:
    """A DataError for a misspelt name, listing the close matches first; meant: known ones also called so."""
    near = get_close_matches(name, known, n=3, cutoff=0.8 if meant else 0.4)
    close = list(dict.fromkeys([*near, *meant]))
    lowered = [k for k in known if k.lower() == name.lower() and k not in close]
    best = f"close matches: {', '.join(lowered + close)}; " if lowered or close else ""
    return DataError(f"{kind} {name!r} not found; {best}available: {', '.join(known)}")


def comes_from_interrupt(error: BaseException | None) -> bool:
    """Whether an error is what compiled loops turned an interrupt into."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None
