"""A tip-in driven: settled at constant speed, then the pedal down, by mean-value model and by steady map."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from os import cpu_count
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hevopt.car.architecture import Architecture
from hevopt.car_files.load import load_architecture
from hevopt.display.facts import Shown
from hevopt.errors import HevoptError
from hevopt.mean_value import states as s
from hevopt.mean_value.car import car_in_gear, cruise, model_of
from hevopt.mean_value.parameters import FULL_LOAD, Diesel, Drive, Model, curve_of
from hevopt.mean_value.paths import paths
from hevopt.mean_value.rotor import scaled_inertia_kgm2
from hevopt.mean_value.run import STEP_S, Integrator, Run, simulate
from hevopt.tipin.assist import Assist, assisted, help_of, helping
from hevopt.tipin.case import Case, changes_of, varied
from hevopt.tipin.figures import Figures, figures_of
from hevopt.units import KMH_PER_MPS

Array = NDArray[np.float64]

PEDAL_PER_S, DURATION_S = 10.0, 8.0


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class TipIn(Shown):
    """A driven case, and the same car by its steady map, whose gas rests.

    assist: what the machine did, where one helped
    """

    case: Case
    run: Run
    by_map: Run
    figures: Figures
    assist: Assist | None = None


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Manoeuvre(Shown):
    """What all cases of a study share. changes: key path -> value with which the car was read"""

    architecture: Architecture
    diesel: Diesel
    speed_mps: float
    gear: int
    step_s: float = STEP_S
    integrator: Integrator = "rk4"
    changes: Mapping[str, Any] = field(default_factory=dict)


def titled(manoeuvre: Manoeuvre) -> str:
    """A manoeuvre in a few words."""
    kmh, car = manoeuvre.speed_mps * KMH_PER_MPS, manoeuvre.architecture
    locked = "" if car.driveline.converter is None else ", torque converter locked"
    return f"{car.name}, full pedal at {kmh:g} km/h in gear {manoeuvre.gear}{locked}"


def inertia_said(manoeuvre: Manoeuvre) -> str:
    """What is uncertain of a turbocharger's inertia that the engine's file does not give; '' where it does."""
    if "inertia_kgm2" in manoeuvre.architecture.contents["engine"]["mean_value"]["rotor"]:
        return ""
    engine = manoeuvre.diesel.engine
    own, low, high = scaled_inertia_kgm2(engine.compressor.wheel_diameter_m)
    return (
        f"The file gives no inertia of the turbocharger: {own:.2g} kg m² by its size, {low:.2g} and {high:.2g} by "
        f"the two known rotors; --turbo-inertia {low / own:.2f},{high / own:.2f} drives with these."
    )


def tip_in(manoeuvre: Manoeuvre, case: Case) -> TipIn:
    """A case, driven; DataError where the car cannot hold the speed in the gear, or the step is too long."""
    architecture = _architecture(manoeuvre, case)
    found = paths(architecture, manoeuvre.gear, manoeuvre.speed_mps)
    diesel = varied(manoeuvre.diesel, case)
    model = model_of(diesel, car_in_gear(architecture, diesel, found))
    y = cruise(model, manoeuvre.speed_mps)
    helper = help_of(architecture, found, manoeuvre.speed_mps) if case.assist else None
    if helper is not None:
        model = assisted(model, helper)
    down = model._replace(drive=Drive(pedal_rate_ps=PEDAL_PER_S))
    run, by_map = (
        simulate(m, begin, DURATION_S, step_s=manoeuvre.step_s, integrator=manoeuvre.integrator)
        for m, begin in ((down, y), _from_map(model, y))
    )
    helped = None if helper is None else helping(architecture, helper, run)
    return TipIn(case, run, by_map, figures_of(run, by_map), helped)


def _architecture(manoeuvre: Manoeuvre, case: Case) -> Architecture:
    """The car of a case, read afresh where it has other gears."""
    own = manoeuvre.architecture
    changes = {} if own.gearbox is None else changes_of(case, own.gearbox, manoeuvre.gear)
    return load_architecture(own.source, {**manoeuvre.changes, **changes}) if changes else own


def _from_map(model: Model, y: Array) -> tuple[Model, Array]:
    """The same car by its steady map, no machine helping, from the pedal that the map says for the speed."""
    car = model.car._replace(assist_ratio_radpm=0.0)
    y = y.copy()
    torque = y[s.TYRE] / (car.ratio_radpm * car.efficiency)
    y[s.PEDAL] = torque / np.interp(y[s.ENGINE], *curve_of(model.curves, FULL_LOAD))
    return model._replace(car=car, drive=Drive(pedal_rate_ps=PEDAL_PER_S, from_map=1.0)), y


def tip_ins(
    manoeuvre: Manoeuvre,
    cases: Sequence[Case],
    progress: Callable[[str, int, int], None] = lambda text, done, total: None,
) -> list[TipIn | HevoptError]:
    """Every case driven, in their order, as many at once as there are processors; what failed in its place."""

    def one(case: Case) -> TipIn | HevoptError:
        try:
            return tip_in(manoeuvre, case)
        except HevoptError as error:
            return error

    found: list[TipIn | HevoptError] = []
    progress(cases[0].label, 0, len(cases))
    with ThreadPoolExecutor(max_workers=cpu_count()) as threads:
        for n, done in enumerate(threads.map(one, cases), start=1):
            found.append(done)
            if n < len(cases):
                progress(cases[n].label, n, len(cases))
    return found
