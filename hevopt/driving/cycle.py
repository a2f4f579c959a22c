"""Driving cycles: a CSV file of speed over time, checked and read into a frozen type.

Columns: `time_s`; one of `speed_mps`, `speed_kmh`, `speed_mph`; optional `gear` (0 neutral), `clutch_open`
(0 or 1), `grade` (rise / run), `auxiliary_power_w` (electric load). Row k of these holds from its time to the next.
Lines that begin with # are comments.
"""

import csv
import os
import re
from collections.abc import Iterable
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hevopt.display.axes import Panel, drawn_over_time, speed_panel
from hevopt.display.facts import Shown
from hevopt.driving.values import GRADE_MAX, Tell, check_range, check_time_and_speed, whole_numbers
from hevopt.errors import DataError, Fault, close_to
from hevopt.files.lookup import find, read_text, shipped_names
from hevopt.files.shown import printable, shown
from hevopt.units import TO_SI

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SPEED_COLUMNS = ("speed_mps", "speed_kmh", "speed_mph")
COLUMNS = ("time_s", *_SPEED_COLUMNS, "gear", "clutch_open", "grade", "auxiliary_power_w")
_AUXILIARY_MAX_W = 50_000.0
_MEGABYTES_MAX = 50
SAMPLES_MAX = 200_000
# Figures per distance say nothing below this.
DISTANCE_MIN_M = 1.0
# For a log or another tool's cycle given where one of our own is expected.
IMPORT = "a logged drive or another tool's cycle is converted by `hevopt cycles import FILE --out NAME.csv`"
_OTHERS = (".xls", ".xlsx", ".mat", ".vdri", ".vbo", ".tsv")
# Plainer than Python's own: no underscores, no digits of other scripts.
_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Cycle(Shown):
    """A speed trace. `gear` and `clutch_open` are None where the file lists none.

    time_s, speed_mps: (sample,)
    gear: (sample,) 0 neutral; clutch_open: (sample,) bool; grade: (sample,) rise / run
    auxiliary_w: (sample,) electric load in place of the car's, None where the file lists none
    source: the file it was read from, None for a trace that came from none
    """

    name: str
    time_s: NDArray[np.float64]
    speed_mps: NDArray[np.float64]
    grade: NDArray[np.float64]
    gear: NDArray[np.int64] | None = None
    clutch_open: NDArray[np.bool_] | None = None
    source: Path | None = None
    auxiliary_w: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        for field in ("time_s", "speed_mps", "grade", "gear", "clutch_open", "auxiliary_w"):
            values = getattr(self, field)
            if values is not None:
                values = np.array(values)
                values.flags.writeable = False
                object.__setattr__(self, field, values)

    def plot(self, axes: "Iterable[Axes] | None" = None) -> "list[Axes]":
        """Speed over time, below it the gear and the grade where there are any.

        axes: of matplotlib, one for each; by default new ones. Raises DataError where there are not as many.
        """
        panels = [speed_panel(self.speed_mps)]
        if self.gear is not None:
            panels.append(Panel("gear", {"gear": self.gear[:-1]}))
        if self.grade.any():
            panels.append(Panel("grade, %", {"grade": 100 * self.grade[:-1]}))
        return drawn_over_time(
            self.time_s, panels, f"{self.name}, {self.distance_m / 1e3:.2f} km", axes
        )

    def _facts(self) -> dict[str, object]:
        return {
            "name": self.name,
            "samples": len(self.time_s),
            "duration_s": self.duration_s,
            "distance_m": self.distance_m,
            "gears": self.gear is not None,
        }

    @property
    def distance_m(self) -> float:
        """Distance driven, by the trapezoidal rule."""
        return float(np.sum(np.diff(self.time_s) * (self.speed_mps[1:] + self.speed_mps[:-1]) / 2))

    @property
    def duration_s(self) -> float:
        """Time from the first to the last sample."""
        return float(self.time_s[-1] - self.time_s[0])


def load_cycle(name: str | Path) -> Cycle:
    """The cycle of a shipped name (`nedc`) or a CSV file's path; DataError names line and value."""
    if Path(name).suffix.lower() in _OTHERS and os.path.exists(name):
        raise DataError(f"{printable(str(name))}: not a cycle file, NAME.csv; {IMPORT}")
    known = Path(name).suffix and os.path.isfile(name)
    path = Path(name) if known else find("cycles", name, ".csv")
    return cycle_of(path, _text(path))


def _text(path: Path) -> str:
    try:
        return read_text(path, _MEGABYTES_MAX)
    except DataError as error:
        if isinstance(error.__context__, UnicodeDecodeError):
            raise DataError(f"{error}; {IMPORT}") from None
        raise


def shipped_cycles() -> list[Cycle]:
    """Every shipped cycle, by name."""
    return [load_cycle(name) for name in shipped_names("cycles", ".csv")]


def cycle_of(path: Path, text: str) -> Cycle:
    """The cycle that the text of a cycle file holds; the path gives its name and stands in messages."""

    def refuse(line: int, fault: str) -> None:
        raise DataError(f"{path}, line {line}: {fault}")

    return _cycle(path, text, refuse)


def faults_in(path: Path) -> list[Fault | str]:
    """Every faulty line of a cycle file, or else what is wrong with the whole of it."""
    faults: list[tuple[int, str]] = []
    text = _text(path)
    try:
        with np.errstate(
            over="ignore", invalid="ignore"
        ):  # numbers out of range are among the faults
            _cycle(path, text, lambda *fault: faults.append(fault))
    except DataError as error:
        if not faults:
            return [str(error)]
    return [Fault(f"{path}, line {line}", text) for line, text in sorted(faults)]


def _cycle(path: Path, text: str, tell: Tell) -> Cycle:
    header, rows = _rows(path, text, tell)
    columns = {name: np.array([row[i] for _, row in rows]) for i, name in enumerate(header)}
    lines = [line for line, _ in rows]
    speed_column = next(c for c in _SPEED_COLUMNS if c in columns)
    factor = TO_SI.get(speed_column.removeprefix("speed"), ("", 1.0))[1]
    speed_mps = columns[speed_column] * factor
    grade = columns.get("grade", np.zeros(len(rows)))
    check_time_and_speed(lines, columns["time_s"], speed_mps, speed_column, factor, tell)
    check_range(lines, "grade", grade, -GRADE_MAX, GRADE_MAX, tell, ", rise over run: 5 % is 0.05")
    auxiliary = columns.get("auxiliary_power_w")
    if auxiliary is not None:
        check_range(lines, "auxiliary_power_w", auxiliary, 0.0, _AUXILIARY_MAX_W, tell)
    gear = clutch_open = None
    if "gear" in columns:
        gear = whole_numbers(lines, "gear", columns["gear"], 20, tell)
        clutch = columns.get("clutch_open", np.zeros(len(rows)))
        clutch_open = whole_numbers(lines, "clutch_open", clutch, 1, tell).astype(bool)
    cycle = Cycle(
        printable(path.stem),
        columns["time_s"],
        speed_mps,
        grade,
        gear,
        clutch_open,
        path,
        auxiliary,
    )
    if cycle.distance_m < DISTANCE_MIN_M:
        raise DataError(
            f"{path}: distance {cycle.distance_m:.3g} m; a cycle must cover {DISTANCE_MIN_M:g} m or "
            "more; check the column's unit"
        )
    return cycle


def _rows(path: Path, text: str, tell: Tell) -> tuple[list[str], list[tuple[int, list[float]]]]:
    """Header names and the numbers of every good data line, with its line number."""
    header: list[str] | None = None
    rows: list[tuple[int, list[float]]] = []
    for number, line in enumerate(re.split(r"\r\n|\n|\r", text), start=1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        try:
            cells = [cell.strip() for cell in _cells(line)]
        except csv.Error as error:
            tell(number, f"not a CSV line ({error})")
            continue
        if header is None:
            header = _checked_header(path, number, cells)
            continue
        if len(cells) != len(header):
            tell(number, f"{len(cells)} values, the header has {len(header)}")
            continue
        if len(rows) == SAMPLES_MAX:
            tell(
                number,
                f"more than the {SAMPLES_MAX} data lines allowed; shorten the cycle or use longer time "
                "steps",
            )
            break
        read = [_number(number, *pair, tell) for pair in zip(header, cells, strict=True)]
        values = [value for value in read if value is not None]
        if len(values) == len(read):
            rows.append((number, values))
    if header is None:
        raise DataError(f"{path}: empty; expected a header line such as time_s,speed_kmh")
    if len(rows) < 2:
        raise DataError(f"{path}: {len(rows)} data lines; a cycle needs at least 2")
    return header, rows


def _cells(line: str) -> list[str]:
    """The cells of a line; csv.Error for a line that is none of CSV."""
    plain = '"' not in line and len(line) < csv.field_size_limit()
    return line.split(",") if plain else next(csv.reader([line], strict=True))


def _checked_header(path: Path, number: int, cells: list[str]) -> list[str]:
    unknown = [cell for cell in cells if cell not in COLUMNS]
    if unknown:
        hint = close_to(unknown[0].lower(), COLUMNS, count=2, cutoff=0.7)
        raise DataError(
            f"{path}, line {number}: unknown column {shown(unknown[0])}; {hint}"
            f"allowed: {', '.join(COLUMNS)}; {IMPORT}"
        )
    if len(set(cells)) != len(cells):
        twice = next(cell for cell in cells if cells.count(cell) > 1)
        raise DataError(f"{path}, line {number}: column {twice} stands twice; remove one")
    speeds = [cell for cell in cells if cell in _SPEED_COLUMNS]
    if "time_s" not in cells or len(speeds) != 1:
        raise DataError(
            f"{path}, line {number}: found columns {', '.join(cells)}; needed: time_s and exactly "
            f"one of {', '.join(_SPEED_COLUMNS)}; {IMPORT}"
        )
    if "clutch_open" in cells and "gear" not in cells:
        raise DataError(f"{path}, line {number}: clutch_open without gear; add the column gear")
    return cells


def _number(line: int, column: str, cell: str, tell: Tell) -> float | None:
    if not _NUMBER.fullmatch(cell):
        tell(
            line,
            f"{column} is {shown(cell)}, not a number; a finite number such as 12.5 is needed",
        )
        return None
    value = float(cell)
    if not isfinite(value):
        tell(line, f"{column} is {shown(cell)}; a finite number is needed")
        return None
    return value
