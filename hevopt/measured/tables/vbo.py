"""Text files of VBOX loggers (.vbo): sections, of which one names the columns and one has the rows.

    [header]         what each column is, such as `velocity kmh`, or the further channels alone
    [channel units]  units of the further channels, which are the last columns
    [column names]   the columns by short names, in one line
    [data]           a row a sample: time as hhmmss.ss, velocity in km/h, height in m, heading in degrees

Layout: Racelogic, VBO file format, and files that other loggers write in it.
"""

import re
from collections.abc import Iterator
from dataclasses import replace
from itertools import chain
from pathlib import Path

from hevopt.errors import DataError
from hevopt.measured.tables.names import PACKED_CLOCK, unit_in_name
from hevopt.measured.tables.rows import Row, Table, table_of
from hevopt.units import unit_named

_HEAD_LINES = 5000
_NAMES, _DATA = "[column names]", "[data]"
_CONVENTION = {"time": PACKED_CLOCK, "velocity": "km/h", "height": "m", "heading": "deg"}


def vbo_table(path: Path, lines: list[str]) -> Table | None:
    """The table of a .vbo file's lines; None where they are none."""
    sections = _sections(lines)
    if _NAMES not in sections or _DATA not in sections:
        return None
    first = next((n for n in sections[_NAMES] if lines[n].strip()), None)
    names = [] if first is None else _cells(lines[first])
    if not names:
        raise DataError(
            f"{path}: no names of columns in its section {_NAMES}; correct the file, or export it from the logger "
            "once more"
        )
    rows = _rows(lines, sections[_DATA])
    table = table_of(path, chain([(first + 1, names)], rows), padded=False)
    units = _units(names, *([lines[n].strip() for n in sections.get(name, ()) if lines[n].strip()]
                            for name in ("[header]", "[channel units]")))  # fmt: skip
    table.notes.insert(0, "VBOX file")
    return replace(
        table, units=[units.get(name, "") for name in table.names], units_source="VBOX file"
    )


def _sections(lines: list[str]) -> dict[str, range]:
    """Name in brackets -> indices of its lines, the data's up to the next name or the end."""
    starts = [
        n for n, line in enumerate(lines[:_HEAD_LINES]) if re.fullmatch(r"\[[^\[\]]+\]\s*", line)
    ]
    ends = [*starts[1:], len(lines)]
    found = zip(starts, ends, strict=False)
    return {lines[a].strip().lower(): range(a + 1, b) for a, b in found}


def _cells(line: str) -> list[str]:
    return [cell for cell in re.split(r"[\s,]+", line.strip()) if cell]


def _rows(lines: list[str], section: range) -> Iterator[Row]:
    for n in section:
        if cells := _cells(lines[n]):
            yield n + 1, cells


def _units(names: list[str], header: list[str], channels: list[str]) -> dict[str, str]:
    """Name of a column -> unit, of those that the file or the format gives one."""
    units = {name: _CONVENTION[name.lower()] for name in names if name.lower() in _CONVENTION}
    # Where the header begins with the satellites it lists every column, else the further channels alone.
    if header and header[0].lower().startswith("sat"):
        for name, full in zip(names, header, strict=False):
            unit = unit_in_name(full)[0]
            if unit is not None and name.lower() != "time":
                units[name] = unit
    if len(channels) <= len(names):
        further = zip(names[len(names) - len(channels) :], channels, strict=True)
        units |= {name: unit for name, unit in further if unit_named(unit)}
    return units
