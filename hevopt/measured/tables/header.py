"""Where a table's header is and what it says: names, a units row, further rows of names, headers split otherwise.

Some tools write two headers, one to read and one of codes: both name the columns, and either may hold the units.
"""

import re
from dataclasses import dataclass
from itertools import combinations, pairwise

from hevopt.measured.tables.cells import is_value
from hevopt.measured.tables.names import cleaned, unit_in_cell, unit_in_name
from hevopt.units import unit_named

Row = tuple[int, list[str]]  # line number, cells without blanks around them

_ROWS_MAX = 4
_SPLITS = (r"\t+", ";", r"\|", ",", r"\s{2,}", r"\s+")
_GROUPED_MAX, _TOKENS_MAX = 4, 14


@dataclass(frozen=True, slots=True)
class Header:
    """names: by column; also: by column, from further rows; units: None without a units row.

    rows: the cells of the rows that it takes, which end directly above the data
    """

    names: list[str]
    also: list[tuple[str, ...]]
    units: list[str] | None
    rows: list[list[str]]
    notes: list[str]


def header_of(head: list[Row], start: int, width: int) -> Header:
    """The header above a table's first data row, which is number `start` of the head and `width` cells wide."""
    above = _rows_above(head, start, width)
    if not above:
        numbered = [f"column {i + 1}" for i in range(width)]
        return Header(numbered, [()] * width, None, [], ["no header: columns by number"])
    units_at, units = _units_place(above)
    line, cells = next(row for row in reversed(above) if row[0] != units_at)
    more: list[Row] = []
    for row in reversed([row for row in above if row[0] not in (line, units_at)]):
        if not _names_too(row[1]):
            break
        more.insert(0, row)
    notes = [f"header in line {line}"]
    if units_at is not None:
        notes.append(f"units row in line {units_at}")
    if more:
        notes.append(f"further names in line {', '.join(str(number) for number, _ in more)}")
    names = [cleaned(cell) or f"column {i + 1}" for i, cell in enumerate(cells)]
    also = [tuple(map(cleaned, column)) for column in zip(*(c for _, c in more), strict=True)]
    taken = [row for row in above if row in more or row[0] in (line, units_at)]
    return Header(names, also or [()] * width, units, [c for _, c in taken], notes)


def _rows_above(head: list[Row], start: int, width: int) -> list[Row]:
    """The rows directly above the data that are as wide as it, from the top; the last one may lack two cells."""
    rows: list[Row] = []
    for line, cells in reversed(head[max(start - _ROWS_MAX, 0) : start]):
        short = width - len(cells)
        if short < 0 or short > 2:
            break
        rows.insert(0, (line, cells + [""] * short))
    return rows


def _units_place(above: list[Row]) -> tuple[int | None, list[str] | None]:
    """Line and units of the units row: the last row below some names, or else the one above the names."""
    if len(above) < 2:
        return None, None
    (upper, names), (lower, cells) = above[-2:]
    if units := _units_row(cells, names):
        return lower, units
    if None not in map(unit_in_cell, names) and (units := _units_row(names, cells)):
        return upper, units
    return None, None


def _units_row(cells: list[str], names: list[str]) -> list[str] | None:
    """Units by column where the cells below some names are such; None where they are no units row.

    One that no table knows, such as degC, is kept: it matters only where its column is used.
    """
    units = [unit_in_cell(cell) for cell in cells]
    if not any(unit and unit != "1" and unit_named(unit) for unit in units):
        return None
    strange = units.count(None)
    if not strange:
        return units
    filled = [name for name, cell in zip(names, cells, strict=True) if cell]
    # Titles over groups of columns are no names: they repeat, or leave columns blank.
    named = all(filled) and len(set(filled)) == len(filled) and not any(map(is_value, names))
    if not named or 2 * strange > len(filled) or any(map(is_value, cells)):
        return None
    return [cell if unit is None else unit for unit, cell in zip(units, cells, strict=True)]


def _names_too(cells: list[str]) -> bool:
    """Whether a row above the names names the columns as well: every one, each otherwise, with words."""
    return all(cells) and len(set(cells)) == len(cells) and not any(map(is_value, cells))


def split_otherwise(line: str, cells: list[str], separator: str, width: int) -> list[str] | None:
    """The names in a header that is not split as its data; None where no way of splitting gives as many.

    cells: as the data's separator splits it. Where nothing but units tells the names apart, each ends in one.
    """
    while cells and not cells[-1]:
        cells = cells[:-1]
    if len(cells) == width:
        return None
    for pattern in _SPLITS[:-1]:
        split = [cell.strip(' "') for cell in re.split(pattern, line.strip())]
        while split and not split[-1]:
            split.pop()
        if len(split) == width and all(split):
            return split
    joint = f"{separator} " if separator.strip() and len(cells) > width else " "
    grouped = _by_units(cells if len(cells) > width else line.split(), joint, width)
    words = line.split()
    return grouped or (words if len(words) == width else None)


def _by_units(tokens: list[str], joint: str, width: int) -> list[str] | None:
    if not 2 <= width <= _GROUPED_MAX or not width <= len(tokens) <= _TOKENS_MAX:
        return None
    ways = []
    for ends in combinations(range(1, len(tokens)), width - 1):
        groups = [joint.join(tokens[a:b]) for a, b in pairwise((0, *ends, len(tokens)))]
        if all((unit := unit_in_name(group)[0]) and unit_named(unit) for group in groups):
            ways.append(groups)
    return ways[0] if len(ways) == 1 else None
