"""Columns of a measured table in SI: by the unit that the file states, or the one that the user gives."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hevopt.display.facts import Shown
from hevopt.errors import DataError
from hevopt.files.shown import shown
from hevopt.measured.tables.rows import listed
from hevopt.measured.tables.table import Column, Measured
from hevopt.units import Unit, unit_named, units_of

Array = NDArray[np.float64]

_DAY_S = 86400.0
_USUAL_STEPS_S = (0.1, 0.2, 0.25, 0.5, 1.0, 2.0, 5.0, 10.0, 30.0, 60.0)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Quantity(Shown):
    """A column in SI.

    values: (row,); quantity: a key of the unit table; note: the column's name, its unit and how that is known
    """

    name: str
    quantity: str
    values: Array
    note: str


def numbers_of(column: Column) -> Array:
    """The column's values; DataError where its numbers could mean two things."""
    if column.unclear:
        raise DataError(column.unclear)
    return column.values


def in_si(
    measured: Measured,
    column: Column,
    allowed: Sequence[str],
    option: str,
    unit: str | None = None,
    *,
    text_as_empty: bool = False,
) -> Quantity:
    """A column in SI by its unit, or by `unit` where the user gives one with the option.

    allowed: quantities of the unit table that will do, such as "speed"; DataError for a missing or other unit, and
    for cells that are no numbers unless those count as empty.
    """
    values = numbers_of(column)
    given, source = (unit, option) if unit is not None else (column.unit, column.source)
    known = known_unit(measured, column, given, allowed, option)
    if column.fixed and known != unit_named(column.unit):
        raise DataError(
            f"{measured.path}: column {column.name} holds {column.source}, which are never taken in "
            f"{shown(unit)}; leave {option} out"
        )
    if unit is None:
        _refuse_contradiction(measured, column, allowed, option)
    if column.strange and not text_as_empty:
        faults = [f"line {measured.lines[row]}: {shown(text)}" for row, text in column.strange]
        more = column.strange_count - len(faults)
        raise DataError(
            f"{measured.path}: column {column.name}: {listed(faults)}{f' and {more} more' * (more > 0)}: not "
            "usable numbers; correct these cells, or empty them"
        )
    if unit is not None and column.unit is not None and unit_named(column.unit) != known:
        source += f", against {column.unit} in the file"
    values = values * known.si
    values.flags.writeable = False
    note = f"{column.name} in {known.symbol} ({source})"
    return Quantity(column.name, known.quantity, values, note)


def _refuse_contradiction(
    measured: Measured, column: Column, allowed: Sequence[str], option: str
) -> None:
    """DataError where the file states two units; a suffix of another quantity is taken for a part of the name."""
    if column.against is None:
        return
    unit, how = column.against
    if how != "suffix of the name" or unit_named(unit).quantity in allowed:
        raise DataError(
            f"{measured.path}: column {column.name}: unit {shown(column.unit)} ({column.source}), but "
            f"{shown(unit)} ({how}); correct the file, or say which holds with {option}"
        )


def unit_missing(column: Column, allowed: Sequence[str], option: str) -> str:
    """What to say of a column whose unit nothing names."""
    choices = ", ".join(symbol for quantity in allowed for symbol in units_of(quantity))
    hint = ""
    if "time" in allowed and len(column.values) > 1:
        step_s = float(np.median(np.diff(column.values))) * _DAY_S
        if any(abs(step_s / usual - 1) < 1e-3 for usual in _USUAL_STEPS_S):
            hint = f"; as days, in which spreadsheets keep times, its steps are {step_s:.3g} s"
    return (
        f"the unit of column {column.name} is not in the file; give it with {option}, "
        f"or in the header, such as {column.name} [{units_of(allowed[0])[0]}]; known: {choices}{hint}"
    )


def known_unit(
    measured: Measured, column: Column, given: str | None, allowed: Sequence[str], option: str
) -> Unit:
    """The unit with a text, if it measures one of the allowed quantities."""
    choices = ", ".join(symbol for quantity in allowed for symbol in units_of(quantity))
    if given is None:
        raise DataError(f"{measured.path}: {unit_missing(column, allowed, option)}")
    known = unit_named(given)
    if known is None or known.quantity not in allowed:
        what = "is unknown" if known is None else f"is one of {known.quantity}"
        raise DataError(
            f"{measured.path}: column {column.name}: unit {shown(given)} {what}; needed is {' or '.join(allowed)}; "
            f"known: {choices}; correct the header, or give the unit with {option}"
        )
    return known
