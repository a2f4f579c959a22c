"""The cars of ranges of sizes, by factors of the sizes that a car's file has, within linear constraints."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.car_files.load import load_architecture
from hevopt.errors import DataError
from hevopt.problem.arrays import Array
from hevopt.sizing.proof.entries import Box
from hevopt.sizing.proof.laws import check_car, corners_of
from hevopt.sizing.proof.limits import meets
from hevopt.sizing.proof.modes import NotProvable
from hevopt.sweeps.plan.linear import half_spaces

# Key path -> which size it is a factor of, and whether it is a whole number.
SIZES: dict[str, tuple[int, bool]] = {
    "engine.scale.displacement": (0, False), "engine.scale.torque": (0, False), "engine.scale.power": (0, False),
    "machine.scale.power": (1, False), "machine.scale.torque": (1, False),
    "battery.cells_in_series": (2, True), "battery.parallel": (2, True), "battery.scale.capacity": (2, False),
}  # fmt: skip
# The one ratio with a range: it is branched over.
DRIVE = "gearbox.final_drive_ratio"


class Space:
    """The cars of some ranges, by factors of the sizes of a car as its file has it."""

    def __init__(
        self,
        architecture: str,
        ranges: Mapping[str, tuple[float, float]],
        fixed: Mapping[str, Any],
        constraints: Sequence[str] = (),
    ) -> None:
        self.architecture, self.ranges, self.fixed = architecture, dict(ranges), dict(fixed)
        self.base = load_architecture(architecture, fixed)
        check_car(self.base)
        self.low, self.high, self._one = np.ones(3), np.ones(3), np.ones(3)
        self.drive = self.ranges.get(DRIVE)
        self._geared: dict[float, Architecture] = {}
        seen: dict[int, str] = {}
        for key, (low, high) in self.ranges.items():
            if key == DRIVE and 0 < low < high:
                continue
            if key not in SIZES:
                raise NotProvable(
                    f"{key}: no proof over its range; there is one for {', '.join([*SIZES, DRIVE])}"
                )
            size, _ = SIZES[key]
            if size in seen:
                raise NotProvable(f"{key} and {seen[size]} are one size; give one of them")
            if not 0 < low <= high:
                raise NotProvable(f"{key}: {low:g} to {high:g} is no range")
            seen[size] = key
            part, _, inner = key.partition(".")
            self._one[size] = _own(self.base.contents[part], inner)
            self.low[size], self.high[size] = low / self._one[size], high / self._one[size]
        self.within: list[str] = []
        self.apart: list[str] = []
        rows = [np.zeros((0, 4))]
        held = {k: float(v) for k, v in self.fixed.items() if isinstance(v, int | float)}
        for text in constraints:
            lines, whole = half_spaces(text, held)
            sizes = self.ranges.keys() - {DRIVE}
            known = [line for line in lines if line.keys() - {""} <= sizes]
            (self.within if whole and known == lines else self.apart).append(text)
            rows += map(self._row, known)
        self.root = Box(self.low, self.high, np.vstack(rows), self.drive)
        if not len(self.root.corners):
            raise DataError(
                "no car of the ranges meets the constraints; loosen one or widen a range"
            )

    def _row(self, line: Mapping[str, float]) -> Array:
        """(1, 4) a line of parameters as one of factors."""
        row = np.zeros((1, 4))
        row[0, 0] = line.get("", 0.0)
        for key, factor in line.items():
            if key:
                row[0, 1 + SIZES[key][0]] += factor * self._one[SIZES[key][0]]
        return row if row[0, 1:].any() else np.zeros((0, 4))

    def whole(self, theta: Array) -> Array | None:
        """The nearest factors with whole cells that meet the limits; None where neither number of cells does."""
        for key in self.ranges.keys() - {DRIVE}:
            size, is_whole = SIZES[key]
            if is_whole:
                value = theta[size] * self._one[size]
                near = sorted((np.floor(value), np.ceil(value)), key=lambda n: abs(n - value))
                found = [theta.copy() for _ in near]
                for each, cells in zip(found, near, strict=True):
                    each[size] = cells / self._one[size]
                kept = [each for each in found if meets(self.root.rows, each)]
                return kept[0] if kept else None
        return theta if meets(self.root.rows, theta) else None

    def values(self, theta: Array, drive: float | None = None) -> dict[str, float]:
        """Values of the parameters at some factors and final drive, cells rounded, as a car has them."""
        found: dict[str, float] = {}
        for key in self.ranges:
            if key == DRIVE:
                found[key] = self.middle_drive(self.drive) if drive is None else drive
                continue
            size, is_whole = SIZES[key]
            value = float(theta[size] * self._one[size])
            found[key] = round(value) if is_whole else value
        return found

    @staticmethod
    def middle_drive(drive: tuple[float, float] | None) -> float:
        """The middle of a range of final drives; 0 where there is none."""
        return 0.0 if drive is None else (drive[0] + drive[1]) / 2

    def car(self, theta: Array, drive: float | None = None) -> Architecture:
        """The car of some factors, whole cells, and a final drive, that of the middle by default."""
        return load_architecture(self.architecture, {**self.fixed, **self.values(theta, drive)})

    def ends(self, drive: tuple[float, float] | None) -> list[Architecture]:
        """The car of factors 1, with the ends of a range of final drives where there is one."""
        if drive is None:
            return [self.base]
        for ratio in drive:
            if ratio not in self._geared:
                changes = {**self.fixed, DRIVE: ratio}
                self._geared[ratio] = load_architecture(self.architecture, changes)
        return [self._geared[ratio] for ratio in drive]

    def corners(self) -> dict[tuple[int, ...], Architecture]:
        """Corner, 0 or 1 by size, -> its car."""
        return {
            corner: self.car(np.where(np.array(corner) == 1, self.high, self.low))
            for corner in corners_of(3)
        }


def _own(contents: Mapping[str, object], key: str) -> float:
    """A factor or count that a component's file has itself."""
    if not key.startswith("scale."):
        return float(contents.get(key, 1))  # type: ignore[arg-type]
    scale = contents.get("scale")
    own = next(iter(scale.values()), 1.0) if isinstance(scale, Mapping) else 1.0
    return float(own)
