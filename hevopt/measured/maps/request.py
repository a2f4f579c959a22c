"""What an import of a measured map is asked for and gives, whatever the component."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hevopt.car_files.engine import EngineFile
from hevopt.car_files.machine import MachineFile
from hevopt.errors import DataError
from hevopt.files.keypaths import with_changes
from hevopt.files.lookup import find
from hevopt.files.shown import shown
from hevopt.files.toml import Model, read_toml
from hevopt.measured.maps.grid import MapGrid
from hevopt.measured.maps.lines import Lines
from hevopt.measured.maps.tables import Source
from hevopt.units import RPM_PER_RADPS

Array = NDArray[np.float64]

_MEASURED = ("full_load", "fuel_map", "fuel_coefficients", "nox_coefficients", "loss_map")


@dataclass(frozen=True, slots=True)
class Request:
    """What to import. extra: "full", "motoring", "nox" -> its own table; given: key path -> value in its place."""

    source: Source
    extra: Mapping[str, Source]
    like: str | None
    given: Mapping[str, Any]


@dataclass(frozen=True, slots=True, eq=False)
class ImportedMap:
    """A component. contents: of its file, also checked as `file`; origins: key path -> where it comes from;
    notes: what was read, assumed and left out; grid and lines: the map of fuel or loss, and the points behind it
    nox: an engine's map of NOx, on the same axes, and its points; None where it is not known
    """

    contents: Mapping[str, Any]
    file: EngineFile | MachineFile
    origins: Mapping[str, str]
    notes: tuple[str, ...]
    grid: MapGrid
    lines: Lines
    nox: tuple[MapGrid, Lines] | None = None


def like_component(name: str | None, model: type[Model]) -> Model | None:
    """The component that gives keys; DataError where it is scaled, as its keys are not those of its size then."""
    if name is None:
        return None
    found = read_toml(find("architectures/components", name, ".toml"), model)
    if found.scale is not None:
        raise DataError(
            f"--like {name}: this component is scaled; name the one that it scales, or copy its keys with --set"
        )
    return found


def with_given(
    base: dict[str, Any], origins: dict[str, str], given: Mapping[str, Any]
) -> tuple[dict[str, Any], dict[str, str]]:
    """Keys and their origins with those that the user gives in their place; DataError for what is measured."""
    for key in given:
        head = key.split(".")[0]
        if head in _MEASURED:
            raise DataError(
                f"--set {shown(key)}: {head} is what the import writes from the measured points; leave it out"
            )
        if head == "scale":
            raise DataError(
                f"--set {shown(key)}: the map is written as measured; give scale where a car uses the component, "
                'such as engine = { file = "./engine.toml", scale = { displacement = 1.2 } }'
            )
    return with_changes(base, given), origins | dict.fromkeys(given, "given")


def check_used(request: Request, used: frozenset[str]) -> None:
    """DataError for a role that an option names and no table holds."""
    named = {*request.source.columns, *request.source.units}
    unused = sorted(named - used)
    if unused:
        raise DataError(
            f"{', '.join(unused)}: named with --column or --unit, but not read; the tables give "
            f"{', '.join(sorted(used))}"
        )


def rpm_list(speed_radps: Array) -> list[float]:
    """Speeds for a component's file, without what a change of units left behind the ninth digit."""
    return [float(f"{s * RPM_PER_RADPS:.9g}") for s in speed_radps]
