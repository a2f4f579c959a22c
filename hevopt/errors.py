"""The errors hevopt raises on purpose.

    HevoptError            exit status
    ├── DataError          2   an input file, a name or an option is wrong
    │   └── UnknownNoxError 2   NOx is asked of an engine without NOx data
    ├── InfeasibleError    3   nothing can follow the cycle, or keep the charge within its limits
    └── SolverError        3   a solver did not return what it promised

A message says where, what was found, what is allowed and what to do next.
"""

from difflib import get_close_matches


class HevoptError(Exception):
    """Base of all errors raised on purpose."""

    exit_status = 1


class DataError(HevoptError):
    """An input is missing, malformed or not physical."""

    exit_status = 2


class UnknownNoxError(DataError):
    """NOx is weighted or cut, and the engine's file has no data on it."""


class InfeasibleError(HevoptError):
    """The problem has no solution, with the first step at which that shows."""

    exit_status = 3


class SolverError(HevoptError):
    """A solver stopped without a usable answer."""

    exit_status = 3


def unknown_name(kind: str, name: str, known: list[str]) -> DataError:
    """A DataError for a misspelt name, listing the close matches first."""
    close = get_close_matches(name, known, n=3, cutoff=0.4)
    lowered = [k for k in known if k.lower() == name.lower() and k not in close]
    best = f"close matches: {', '.join(lowered + close)}; " if lowered or close else ""
    return DataError(f"{kind} {name!r} not found; {best}available: {', '.join(known)}")
