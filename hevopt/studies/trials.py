"""The values at which the figures of a car are tried for their sensitivity."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from hevopt.files.lookup import find
from hevopt.files.toml import read_contents

SHARE = 0.1
_STEEP_NOX = "engine_diesel_1600_steep_nox"
_LOSSES = ("loss_c0_w", "loss_c1_ws", "loss_c2_ws2", "loss_c3_wpnm2", "loss_map.loss_w")


def _of_machines(*keys: str) -> tuple[str, ...]:
    """Key paths of all machines, which are changed together."""
    return tuple(f"{name}.{key}" for name in ("machine", "machine_2", "machine_3") for key in keys)


@dataclass(frozen=True, slots=True)
class Parameter:
    """A figure of a car, or several that are changed together.

    keys: their key paths; the first one that a car has gives the value shown
    step: what is taken away and added; None: a share of 10 %; relative: the value shown is 1, as given
    whole: values are rounded to whole numbers
    others: values tried beside the car's own, which may be 0 or left out, in place of less and more
    """

    name: str
    unit: str
    keys: tuple[str, ...]
    step: float | None = None
    relative: bool = False
    whole: bool = False
    others: tuple[float, ...] = ()


PARAMETERS = (
    Parameter("vehicle mass", "kg", ("car.mass_kg",)),
    Parameter(
        "rolling resistance",
        "coefficient",
        tuple(f"car.road_load.rolling_{c}" for c in ("c0", "c1_spm", "c2_s2pm2", "c3_s3pm3")),
    ),
    Parameter("drag area", "m²", ("car.road_load.drag_area_m2",)),
    Parameter(
        "coast-down resistance",
        "x as given",
        tuple(f"car.road_load.coastdown_{c}" for c in ("c0_n", "c1_nspm", "c2_ns2pm2")),
        relative=True,
    ),
    Parameter("auxiliaries", "W", ("car.auxiliary_power_w",)),
    Parameter("driveline efficiency", "share", ("gearbox.efficiency",), step=0.01),
    Parameter("machine loss", "x as given", _of_machines(*_LOSSES), relative=True),
    Parameter("machine efficiency", "share", _of_machines("efficiency"), step=0.02),
    Parameter(
        "battery resistance",
        "ohm per cell",
        ("battery.resistance_ohm", "battery.discharge_ohm", "battery.charge_ohm"),
    ),
    Parameter("coulombic efficiency", "share", ("battery.coulombic_efficiency",), step=0.01),
    Parameter("battery cells in series", "cells", ("battery.cells_in_series",), whole=True),
    Parameter("engine inertia", "kg m²", ("engine.inertia_kgm2",)),
    Parameter("machine inertia", "kg m²", _of_machines("inertia_kgm2")),
    Parameter("spin efficiency", "share", _of_machines("spin_efficiency"), step=0.05),
    Parameter("fuel of a start", "g", ("engine.start_fuel_g",)),
    Parameter("machine's share of braking", "mean share", ("car.braking.machine_share",)),
    Parameter("gap at a change of gear", "s", ("gearbox.shift_gap_s",), others=(0.0, 1.0)),
    Parameter(
        "least time on and off", "s", ("engine.least_on_s", "engine.least_off_s"), others=(2.0, 4.0)
    ),
)


@dataclass(frozen=True, slots=True)
class Trial:
    """Values of a parameter, lowest first, and the changes that lead to each; {} is the car as given."""

    parameter: Parameter
    values: list[float]
    changes: list[Mapping[str, Any]]


def trials_of(contents: Mapping[str, Any]) -> list[Trial]:
    """A trial for every parameter that a car, given by its files' keys and values, has."""
    trials = [_trial(contents, parameter) for parameter in PARAMETERS]
    nox = contents.get("engine", {}).get("nox_coefficients")
    if nox is not None:
        steep = read_contents(find("architectures/components", _STEEP_NOX, ".toml"))
        trials.append(_nox_trial(nox, steep["nox_coefficients"]))
    return [trial for trial in trials if trial is not None]


def _trial(contents: Mapping[str, Any], parameter: Parameter) -> Trial | None:
    """None where the car lacks the figure, has it at 0, or cannot have another."""
    if parameter.others:
        return _others(contents, parameter)
    found = {key: value for key in parameter.keys if (value := _at(contents, key)) is not None}
    if not found:
        return None
    first = _mean(next(iter(found.values())))
    if first <= 0:
        return None
    step = SHARE * first if parameter.step is None else parameter.step
    points: dict[float, Mapping[str, Any]] = {}
    for target in (first - step, first, first + step):
        value = round(target) if parameter.whole else target
        if value <= 0 or (parameter.step is not None and value > 1):
            continue
        changes = {
            key: value if old == first else _times(old, value / first) for key, old in found.items()
        }
        points[value / first if parameter.relative else value] = {} if value == first else changes
    return Trial(parameter, list(points), list(points.values())) if len(points) > 1 else None


def _others(contents: Mapping[str, Any], parameter: Parameter) -> Trial | None:
    """The car's own value and some others; None where it lacks the component."""
    component = parameter.keys[0].partition(".")[0]
    if component not in contents:
        return None
    own = max(float(_at(contents, key) or 0.0) for key in parameter.keys)
    changes: dict[float, Mapping[str, Any]] = {
        value: dict.fromkeys(parameter.keys, value) for value in parameter.others
    }
    points = dict(sorted({**changes, own: {}}.items()))
    return Trial(parameter, list(points), list(points.values()))


def _nox_trial(own: Mapping[str, float], steep: Mapping[str, float]) -> Trial | None:
    """The steep set of NOx coefficients, by how many times a high load emits a low load's NOx per work."""
    parameter = Parameter("NOx map, high over low load", "ratio", ("engine.nox_coefficients",))
    if own["lo"] <= 0 or dict(own) == dict(steep):
        return None
    pairs = [(own["hi"] / own["lo"], {}), (steep["hi"] / steep["lo"], {parameter.keys[0]: steep})]
    pairs.sort(key=lambda pair: pair[0])
    return Trial(parameter, [value for value, _ in pairs], [changes for _, changes in pairs])


def _at(contents: Mapping[str, Any], key: str) -> Any:
    value: Any = contents
    for part in key.split("."):
        value = value.get(part) if isinstance(value, Mapping) else None
    return value


def _mean(value: Any) -> float:
    """The value, or the mean of a list's."""
    return sum(map(_mean, value)) / len(value) if isinstance(value, list) else value


def _times(value: Any, factor: float) -> Any:
    return [_times(entry, factor) for entry in value] if isinstance(value, list) else value * factor
