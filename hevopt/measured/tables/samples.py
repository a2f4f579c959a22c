"""Of a log with one signal a row (signals.py) the rows of one signal, the others at its moments."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hevopt.measured.tables.table import Column, Measured

Rows = NDArray[np.int64]


def at_samples_of(measured: Measured, column: Column) -> Measured:
    """A log of signals at the rows of one of them; any other table as it is.

    The others are drawn straight between their samples, those without a unit, such as a gear, are held.
    """
    if column.sampled is None:
        return measured
    time_s = measured.columns[0].values
    columns = tuple(_at(other, time_s, column.sampled) for other in measured.columns)
    note = f"rows of {column.name}; other signals drawn straight between their samples"
    return replace(
        measured,
        columns=columns,
        lines=measured.lines[column.sampled],
        notes=(*measured.notes, note),
    )


def _at(column: Column, time_s: NDArray[np.float64], rows: Rows) -> Column:
    """A column of a log at some rows, where text is kept if they are its own."""
    place = {int(row): n for n, row in enumerate(rows)}
    strange = tuple((place[row], text) for row, text in column.strange if row in place)
    words = {text: [place[r] for r in of if r in place] for text, of in column.words.items()}
    values = column.values[rows]
    own = column.sampled[np.isfinite(column.values[column.sampled] + time_s[column.sampled])]
    own = own[np.argsort(time_s[own], kind="stable")]
    if not np.isin(rows, column.sampled).any() and len(own):
        if column.unit:
            values = np.interp(time_s[rows], time_s[own], column.values[own])
        else:
            at = np.searchsorted(time_s[own], time_s[rows], side="right") - 1
            values = column.values[own[np.maximum(at, 0)]]
    values.flags.writeable = False
    return replace(
        column,
        values=values,
        strange=strange,
        strange_count=len(strange),
        words=words,
        sampled=None,
    )
