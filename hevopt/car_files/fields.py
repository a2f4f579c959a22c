"""What the models of several kinds of file share: bounded numbers, texts, shapes of values, grids and scales.

Keys carry their unit as a suffix; bounds are wide where physics sets none, and keep arithmetic from overflowing.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, ConfigDict, Discriminator, Field, Tag, model_validator

from hevopt.files.toml import SHAPES, FileModel, shape_of

_MAP_MAX = 1e6
_EFFICIENCY_MIN = 0.01
Array = NDArray[np.float64]


def _on_one_line(text: str) -> str:
    if not text.isprintable() or text.isspace():
        raise ValueError("printable characters on one line are needed")
    return text


Number, List, Table, Named = map(Tag, SHAPES)
Shape = Discriminator(shape_of)
Name = Annotated[str, Field(min_length=1, max_length=80), AfterValidator(_on_one_line)]
Description = Annotated[str, Field(max_length=500), AfterValidator(_on_one_line)]
# Wide bounds: their task is that no sum or square of what a file holds overflows.
Fraction = Annotated[float, Field(ge=0.01, le=1)]
Soc = Annotated[float, Field(ge=0, le=1)]
Positive = Annotated[float, Field(ge=1e-6, le=1e9)]
NotNegative = Annotated[float, Field(ge=0, le=1e9)]
Coefficient = Annotated[float, Field(ge=-1e6, le=1e6)]
Ratio = Annotated[float, Field(ge=0.01, le=50)]
Curve = Annotated[list[Coefficient], Field(min_length=2, max_length=10_000)]
Speeds = Annotated[
    list[Annotated[float, Field(ge=0, le=1e6)]], Field(min_length=2, max_length=10_000)
]
Mass = Annotated[float, Field(ge=50, le=100_000)]
AuxiliaryPower = Annotated[float, Field(ge=0, le=50_000)]
StartFuel = Annotated[float, Field(ge=0, le=100)]
ShiftFuel = Annotated[float, Field(ge=0, le=10)]
ScaleFactor = Annotated[float, Field(ge=0.05, le=20)]
# Mass or price of a size.
Specific = Annotated[float, Field(ge=0, le=1e6)]


def check_grid(name: str, grid: list[list[float]], rows: int, columns: int) -> None:
    """ValueError where a measured map has another shape, no value at all, or one out of range."""
    if len(grid) != rows or any(len(row) != columns for row in grid):
        raise ValueError(f"{name} must have {rows} rows of {columns} values")
    values = np.array(grid)
    if np.isnan(values).all():
        raise ValueError(f"{name} holds nan only; give the measured values")
    if not (np.isnan(values) | ((values >= 0) & (values <= _MAP_MAX))).all():
        raise ValueError(f"{name}: allowed: 0 to {_MAP_MAX:g}, or nan where not measured")


def check_efficiency(share: Array, hint: str) -> None:
    """ValueError where an efficiency, (point,), is above 1 in most points, or nowhere 0.01: units are mistaken."""
    if not len(share):
        return
    middle, best = float(np.median(share)), float(np.max(share))
    if middle > 1 or best < _EFFICIENCY_MIN:
        found = (
            f"most are above {100 * middle:.3g}" if middle > 1 else f"the best is {100 * best:.3g}"
        )
        raise ValueError(f"of efficiencies {found} %; allowed: 1 to 100 %; {hint}")


@dataclass(frozen=True)
class KeysOfKind:
    """Which keys go with which `kind` of a table: kind -> keys that it needs, and those it may have besides."""

    needed: Mapping[str, set[str]]
    besides: Mapping[str, set[str]]

    def check(self, kind: str, given: set[str]) -> None:
        """ValueError where a table lacks a key of its kind or has one of another."""
        if missing := self.needed[kind] - given:
            raise ValueError(f"kind {kind!r} needs {', '.join(sorted(missing))}")
        if extra := given & self._of_others(kind):
            raise ValueError(f"kind {kind!r} does not use {', '.join(sorted(extra))}")

    def schema(self) -> dict[str, Any]:
        """The same as part of a JSON Schema."""
        return {
            "allOf": [
                {
                    "if": {"properties": {"kind": {"const": kind}}, "required": ["kind"]},
                    "then": {
                        "required": sorted(needed),
                        "properties": dict.fromkeys(sorted(self._of_others(kind)), False),
                    },
                }
                for kind, needed in self.needed.items()
            ]
        }

    def _of_others(self, kind: str) -> set[str]:
        every = set().union(*self.needed.values(), *self.besides.values())
        return every - self.needed[kind] - self.besides.get(kind, set())


class ScaleFile(FileModel):
    """Another size of the same design: one factor, called by any of its names; see car/engine.py."""

    model_config = ConfigDict(json_schema_extra={"minProperties": 1, "maxProperties": 1})

    torque: ScaleFactor | None = None
    power: ScaleFactor | None = None

    @model_validator(mode="after")
    def _one_name(self) -> Self:
        given = sorted(self.model_fields_set)
        if len(given) != 1:
            names = ", ".join(type(self).model_fields)
            raise ValueError(
                f"give exactly one of {names}: speeds stay, so that they are one factor; "
                f"found: {', '.join(given) or 'none'}"
            )
        return self

    @property
    def factor(self) -> float:
        """The factor given."""
        return float(next(value for value in self.model_dump().values() if value is not None))


class FullLoadFile(FileModel):
    """The highest torque over speed."""

    speed_rpm: Speeds
    torque_nm: Curve

    @model_validator(mode="after")
    def _curve(self) -> Self:
        if len(self.speed_rpm) != len(self.torque_nm):
            raise ValueError("speed_rpm and torque_nm must have one length")
        if (np.diff(self.speed_rpm) <= 0).any():
            raise ValueError("speed_rpm must increase")
        if min(self.torque_nm) <= 0:
            raise ValueError(f"every torque_nm must be > 0, found {min(self.torque_nm):g}")
        return self
