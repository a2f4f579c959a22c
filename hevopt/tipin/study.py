"""Tip-ins from Python: a car's name, what is varied, and what comes of it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hevopt.car.engine import Engine
from hevopt.car_files.components import engine_of
from hevopt.car_files.engine import EngineFile
from hevopt.car_files.load import load_architecture
from hevopt.car_files.mean_value_parts import mean_value_of
from hevopt.display.facts import Shown
from hevopt.errors import DataError, HevoptError
from hevopt.files.lookup import find
from hevopt.files.toml import checked, read_contents
from hevopt.mean_value.car import BENCH, model_of
from hevopt.mean_value.full_load import FullLoad, full_load
from hevopt.mean_value.run import STEP_S, Integrator
from hevopt.tipin.case import BASE, Case, variation
from hevopt.tipin.drive import Manoeuvre, TipIn, tip_ins
from hevopt.units import KMH_PER_MPS

_LEAST_KMH, _MOST_KMH = 1.0, 400.0


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class TipInStudy(Shown):
    """Tip-ins of one car. found: the cases driven, the car as it is first; failed: label -> why a case was not"""

    manoeuvre: Manoeuvre
    found: tuple[TipIn, ...]
    failed: Mapping[str, HevoptError]


def tip_in_study(
    car: str | Path = "compact_1300",
    *,
    speed_mps: float = 40 / KMH_PER_MPS,
    gear: int = 4,
    smoke: Sequence[float] = (),
    turbo_inertia: Sequence[float] = (),
    final_drive: Sequence[float] = (),
    gear_ratio: Sequence[float] = (),
    egr: Sequence[float] = (),
    e_boost: bool = False,
    integrator: Integrator = "rk4",
    step_s: float = STEP_S,
    changes: Mapping[str, Any] | None = None,
    progress: Callable[[str, int, int], None] = lambda text, done, total: None,
) -> TipInStudy:
    """The pedal to the floor at constant speed: mean-value engine beside steady map, and what changes it.

    car: name or file of an architecture whose engine has a mean_value part; changes: key path -> value in its place
    smoke: least lambda of the smoke limit; turbo_inertia, egr: factors of the turbocharger's inertia and of the
    recirculation valve's opening; final_drive, gear_ratio: ratios in place of the gearbox's; each value is a case
    e_boost: one more case, in which the car's machine fills what the engine lacks
    integrator: "rk4" with step_s, or "lsoda"; progress: called with a case, and how many are done of how many
    Raises DataError for what is missing, or for a car that cannot hold the speed in the gear as it is.
    """
    manoeuvre = manoeuvre_of(
        car, speed_mps, gear, integrator=integrator, step_s=step_s, changes=changes
    )
    lists = {
        "smoke": smoke, "turbo_inertia": turbo_inertia, "final_drive": final_drive,
        "gear_ratio": gear_ratio, "egr": egr,
    }  # fmt: skip
    return study_of(manoeuvre, cases_of(lists, e_boost), progress)


def manoeuvre_of(
    car: str | Path,
    speed_mps: float,
    gear: int,
    *,
    integrator: Integrator = "rk4",
    step_s: float = STEP_S,
    changes: Mapping[str, Any] | None = None,
) -> Manoeuvre:
    """What all cases of a study share; see `tip_in_study`."""
    if not _LEAST_KMH <= round(speed_mps * KMH_PER_MPS, 9) <= _MOST_KMH:
        raise DataError(
            f"--from {speed_mps * KMH_PER_MPS:g}; allowed: {_LEAST_KMH:g} to {_MOST_KMH:g} km/h"
        )
    given = dict(changes or {})
    architecture = load_architecture(car, given)
    diesel = mean_value_of(f"{architecture.source}, engine", architecture.contents["engine"])
    return Manoeuvre(architecture, diesel, speed_mps, gear, step_s, integrator, given)


def cases_of(lists: Mapping[str, Sequence[float]], e_boost: bool = False) -> list[Case]:
    """The car as it is, a case for every value of a list by its name, and one with the machine's help."""
    cases = [BASE, *(variation(name, value) for name, values in lists.items() for value in values)]
    return [*cases, Case("e-boost", assist=True)] if e_boost else cases


def study_of(
    manoeuvre: Manoeuvre,
    cases: Sequence[Case],
    progress: Callable[[str, int, int], None] = lambda text, done, total: None,
) -> TipInStudy:
    """The cases driven; the first one's failure is the study's."""
    found = tip_ins(manoeuvre, cases, progress)
    if isinstance(found[0], HevoptError):
        raise found[0]
    failed = {
        case.label: one
        for case, one in zip(cases, found, strict=True)
        if isinstance(one, HevoptError)
    }
    return TipInStudy(manoeuvre, tuple(one for one in found if isinstance(one, TipIn)), failed)


def settled_full_load(
    engine: str | Path = "engine_diesel_1300",
    progress: Callable[[str, int, int], None] = lambda text, done, total: None,
) -> tuple[FullLoad, Engine]:
    """What full pedal settles to at each speed of an engine's full-load curve, and the engine by its map.

    engine: name or file of an engine with a mean_value part; progress: as in `tip_in_study`
    Raises DataError where it has none, SolverError where it does not settle.
    """
    path = find("architectures/components", str(engine), ".toml")
    contents = read_contents(path)
    diesel = mean_value_of(str(path), contents)
    known = engine_of(checked(str(path), contents, EngineFile))
    found = full_load(
        model_of(diesel, BENCH),
        known.full_load_speed_radps,
        lambda done, total: progress("full load", done, total),
    )
    return found, known
