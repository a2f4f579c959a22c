"""Which way each coast-down went: 1 and -1, two other numbers or texts, or headings as angles.

A heading varies from row to row: a run has the circular mean of its rows, and the runs must fall into two groups
about 180° apart.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hevopt.display.facts import Shown
from hevopt.errors import DataError
from hevopt.files.shown import printable
from hevopt.measured.tables.table import Column, Measured
from hevopt.measured.tables.units import in_si, numbers_of
from hevopt.units import unit_named

Array = NDArray[np.float64]

OPTION = "--unit direction=UNIT"
# Within one run; of a run's mean from its group's; of the two groups from opposite.
_SPREAD_MAX = np.radians(30.0)
_RUNS_SHOWN = 6


@dataclass(frozen=True, slots=True)
class Heading:
    """Mean heading of a run, in radians."""

    angle: float


Way = float | str | Heading | None  # of one run; None without a column


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Directions(Shown):
    """A column of directions. values: (row,) numbers, places among the words, or radians where `angles`."""

    values: Array
    words: tuple[str, ...]
    angles: bool
    note: str

    def changes(self) -> NDArray[np.bool_]:
        """(row - 1,) whether the direction of the next row is another, so that a new run begins."""
        steps = np.diff(self.values)
        return np.cos(steps) < 0 if self.angles else steps != 0

    def of_run(self, rows: slice, place: str) -> Way:
        """The direction of a run; DataError where its heading turns."""
        values = self.values[rows]
        if not self.angles:
            return self.words[int(values[0])] if self.words else float(values[0])
        mean = _mean(values)
        off = np.abs(_off(values, mean))
        # Single rows may be wild, as a compass's are; a turn is not.
        if np.quantile(off, 0.9) > _SPREAD_MAX:
            raise DataError(
                f"{place}: the heading is up to {np.degrees(off.max()):.0f}° off its mean of {_degrees(mean)}; a "
                "coast-down goes straight: cut the file to its coasting parts, or mark runs with a column run"
            )
        return Heading(mean)


def directions_in(measured: Measured, column: Column, unit: str | None) -> Directions:
    """The directions in a column; unit: as the user gives it, for a heading."""
    known = unit_named(column.unit) if column.unit else None
    if unit is not None or (known is not None and known.quantity == "angle"):
        found = in_si(measured, column, ("angle",), OPTION, unit)
        return Directions(found.values, (), True, f"mean heading of each run from {found.note}")
    note = f"column {column.name}"
    if column.words:
        codes, words = _coded(column)
        return Directions(codes, words, False, note)
    return Directions(numbers_of(column), (), False, note)


def _coded(column: Column) -> tuple[Array, tuple[str, ...]]:
    """(row,) the number of each row's text, NaN for others, and the texts; capitals do not matter."""
    codes, words = np.full(len(column.values), np.nan), {}
    for text, rows in column.words.items():
        word = words.setdefault(text.casefold(), (len(words), text))
        codes[np.asarray(rows)] = word[0]
    return codes, tuple(text for _, text in words.values())


def signs(
    ways: Sequence[Way], places: Sequence[str], given: Sequence[int] | None, separate: str
) -> tuple[list[int], list[str]]:
    """+1 and -1 of every run, and which is which where a column names them otherwise: +1 is the first met.

    given: by option, in the order of the runs; separate: how runs are told apart, for messages
    """
    if given is not None:
        return _given(ways, places, given, separate), []
    if None in ways:
        raise DataError(
            f"no column of direction for the {len(ways)} run{'s' * (len(ways) > 1)} found; add one (1 and -1), "
            "name it with --column direction=NAME, or give --directions +,-,+,- in the order of the runs; "
            f"{separate}"
        )
    if all(isinstance(way, Heading) for way in ways):
        return _by_heading(np.array([way.angle for way in ways]), places)
    return _by_name(ways)


def _given(
    ways: Sequence[Way], places: Sequence[str], given: Sequence[int], separate: str
) -> list[int]:
    if any(way is not None for way in ways):
        raise DataError(
            "the directions are in a column and in --directions; leave --directions out"
        )
    if len(given) != len(ways):
        raise DataError(
            f"--directions names {len(given)} runs, the files hold {len(ways)}: "
            + "; ".join(places[:_RUNS_SHOWN])
            + f"; {separate}"
        )
    return list(given)


def _by_heading(angles: Array, places: Sequence[str]) -> tuple[list[int], list[str]]:
    """Two groups: runs within 90° of the first one's heading, and the others."""
    along = np.cos(angles - angles[0]) > 0
    if along.all():
        raise DataError(
            f"1 direction found (heading about {_degrees(_mean(angles))}); needed: runs in two opposite "
            "directions, since slope and wind cancel between them; add runs the other way"
        )
    means = [_mean(angles[along]), _mean(angles[~along])]
    off = np.abs(_off(angles, np.where(along, *means)))
    apart = abs(_off(means[1], means[0]))
    if off.max() > _SPREAD_MAX or np.pi - apart > _SPREAD_MAX:
        k = int(off.argmax())
        raise DataError(
            f"the runs' headings are no two opposite directions: {_degrees(means[0])} and {_degrees(means[1])} on "
            f"average, {places[k]} {_degrees(angles[k])}; allowed: within {_SPREAD_MAX * 180 / np.pi:.0f}° of two "
            "headings 180° apart; cut or delete runs of another road"
        )
    note = f"direction: heading about {_degrees(means[0])} counts as +1, {_degrees(means[1])} as -1"
    return [1 if first else -1 for first in along], [note]


def _by_name(ways: Sequence[Way]) -> tuple[list[int], list[str]]:
    spelled: dict[str, str] = {}
    raw = [spelled.setdefault(d.casefold(), d) if isinstance(d, str) else d for d in ways]
    kinds = list(dict.fromkeys(raw))
    names = [_shown(kind) for kind in kinds]
    if len({type(kind) for kind in kinds}) > 1:
        raise DataError(
            f"the files name directions in several ways ({', '.join(names[:5])}); write the same two for all"
        )
    if len(kinds) != 2:
        hint = (
            "; a heading needs its unit, as heading [deg] or --unit direction=deg"
            if len(kinds) > 2 and isinstance(kinds[0], float)
            else ""
        )
        raise DataError(
            f"{len(kinds)} direction{'s' if len(kinds) > 1 else ''} found ({', '.join(names[:5])}); needed: runs "
            "in two opposite directions, since slope and wind cancel between them; add runs the other way"
            + hint
        )
    if set(kinds) == {1.0, -1.0}:
        return [int(direction) for direction in raw], []
    note = f"direction: {names[0]} counts as +1, {names[1]} as -1"
    return [1 if direction == kinds[0] else -1 for direction in raw], [note]


def _shown(kind: Way) -> str:
    if isinstance(kind, Heading):
        return f"heading {_degrees(kind.angle)}"
    return printable(kind) if isinstance(kind, str) else f"{kind:g}"


def _mean(angles: Array) -> float:
    return float(np.angle(np.exp(1j * angles).mean()))


def _off(angles: Array | float, mean: Array | float) -> Array | float:
    return np.angle(np.exp(1j * (angles - mean)))


def _degrees(angle: float) -> str:
    return f"{round(np.degrees(angle) % 360) % 360}°"
