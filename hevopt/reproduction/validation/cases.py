"""The real cars driven over the cycles that laboratories drove them on.

Nothing here is fitted to a laboratory's figure: cars are the shipped files, strategies as `compare` has them. Fuel
is charge-corrected; the bound is that of plans which end with the charge of the start or more.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.car_files.load import load_architecture
from hevopt.display.facts import Shown
from hevopt.driving.cycle import Cycle, load_cycle
from hevopt.driving.demand import demand_of
from hevopt.problem.arrays import Array
from hevopt.problem.problem import Trajectory
from hevopt.reproduction.validation.laboratory import Laboratory, about, changed, laboratories
from hevopt.studies.case import Case, litres, prepare
from hevopt.studies.rows import Row, shortfall_steps
from hevopt.studies.settings import Settings
from hevopt.studies.solved import run_case

# Car without a machine that drives -> its rule, which is causal; else the calibrated rule, and one that is causal.
_PLAIN = ("baseline", "baseline")
_HYBRID = ("conventional", "a_ecms")
_LOAD_KEY = "car.auxiliary_power_w"


class EngineUse(NamedTuple):
    """An engine on a drive: work, MJ/km, efficiency with starts and changes of gear, and the highest of its map."""

    work_mjpkm: float
    efficiency: float
    best_efficiency: float


class Before(NamedTuple):
    """A car's file as it was when first results were seen: what was changed since, and the fuel, l/100 km."""

    changes: tuple[str, ...]
    causal_l_per_100km: float


@dataclass(frozen=True, slots=True, repr=False)
class Held(Shown):
    """A car on a cycle, measured and computed; fuel in l/100 km.

    rule: the best rule, its parameters chosen on the cycle; causal: the best strategy that knows nothing of it
    load: what the bound rises by with the electric load of the other published model
    work_mjpkm, road_mjpkm: positive work at the wheels, of the model and by an integral of its own
    shortfall_steps: steps that the car cannot follow
    engine: of the best causal strategy; before: what it burnt before the file was changed, None where it was not
    """

    laboratory: Laboratory
    rule: Row
    causal: Row
    ecms: Row
    dp: Row
    bound_l_per_100km: float
    proof: str
    load_l_per_100km: float
    loads_w: tuple[float, float]
    work_mjpkm: float
    road_mjpkm: float
    steps: int
    shortfall_steps: int
    engine: EngineUse
    before: Before | None

    def _facts(self) -> dict[str, object]:
        return {"car": self.laboratory.car, "cycle": self.laboratory.cycle,
                "measured": self.laboratory.fuel_l_per_100km, "bound": self.bound_l_per_100km}  # fmt: skip

    @property
    def causal_l_per_100km(self) -> float:
        """Fuel of the best causal strategy."""
        return fuel(self.causal)

    @property
    def off_percent(self) -> float | None:
        """The best causal strategy against the warm car; None where no warm figure is known."""
        warm = self.laboratory.warm_l_per_100km
        return None if warm is None else 100 * (self.causal_l_per_100km / warm - 1)

    @property
    def needed_efficiency(self) -> float | None:
        """Of the engine, to do the causal strategy's work with the warm car's fuel; None where not known."""
        warm = self.laboratory.warm_l_per_100km
        return None if warm is None else self.engine.efficiency * self.causal_l_per_100km / warm


def fuel(row: Row) -> float:
    """Charge-corrected fuel of a row that was solved."""
    assert row.fuel_corrected_l_per_100km is not None
    return row.fuel_corrected_l_per_100km


def hold(
    cars: Sequence[str] | None = None,
    cycles: Sequence[str] | None = None,
    progress: Callable[[str, int, int], None] = lambda text, done, total: None,
) -> list[Held]:
    """Every car and cycle with a test, or those of some cars and cycles; DataError for one without."""
    found = laboratories(cars, cycles)
    held = []
    for n, laboratory in enumerate(found):
        progress(f"{laboratory.car}, {laboratory.cycle}", n, len(found))
        held.append(_held(laboratory))
    return held


def _held(laboratory: Laboratory) -> Held:
    car, cycle = load_architecture(laboratory.car), load_cycle(laboratory.cycle)
    case = prepare(car, cycle, Settings(allow_shortfall=True))
    rule, causal = _HYBRID if "power_management" in car.functions else _PLAIN
    names = dict.fromkeys((rule, causal, "dp"))
    runs = {name: run_case(case, name) for name in names}
    rows = {name: run[0] for name, run in runs.items()}
    # Without a stop of the engine there is nothing to decide but the gear, as dp does.
    rows["ecms"] = run_case(case, "ecms")[0] if "start_stop" in car.functions else rows["dp"]
    bound_kg, proof = case.certificate.bound_kg(case.problem.end_min_j)
    other_w = about()[car.name].other_load_w
    return Held(
        laboratory,
        rows[rule],
        rows[causal],
        rows["ecms"],
        rows["dp"],
        litres(car, cycle, bound_kg),
        str(proof),
        _load(case, bound_kg, other_w),
        (car.vehicle.auxiliary_power_w, other_w),
        demand_of(cycle, car.vehicle, car.gearbox).wheel_work_jpm / 1e3,
        road_work_jpm(car, cycle) / 1e3,
        len(case.problem.table.time_s),
        shortfall_steps(case.problem),
        _engine_use(case, runs[causal][2]),
        _before(case, causal),
    )


def _engine_use(case: Case, trajectory: Trajectory) -> EngineUse:
    flows, step, engine = trajectory.flows, case.problem.table.step_s, case.car.engine
    shaft_w = flows["engine_torque_nm"] * flows["engine_speed_radps"]
    burns = flows["fuel_power_w"] > 0
    work_j = float(np.sum(np.where(burns, shaft_w, 0.0) * step))
    fuel_j = trajectory.total_fuel_kg * engine.heating_value_jpkg
    return EngineUse(work_j / case.cycle.distance_m / 1e3, work_j / fuel_j, engine.best_efficiency)


def _before(case: Case, causal: str) -> Before | None:
    """The causal strategy in the car as its file was."""
    change = changed().get(case.car.name)
    if change is None:
        return None
    car = load_architecture(case.car.source, change.values)
    before = prepare(car, case.cycle, Settings(allow_shortfall=True))
    return Before(change.said, fuel(run_case(before, causal)[0]))


def _load(case: Case, bound_kg: float, other_w: float) -> float:
    """What the bound rises by with another electric load: by what a joule is worth, or without a battery anew."""
    car, cycle = case.car, case.cycle
    if "power_management" in car.functions:
        extra_j = (other_w - car.vehicle.auxiliary_power_w) * float(case.problem.table.step_s.sum())
        return litres(car, cycle, case.certificate.price_kgpj * extra_j)
    other = load_architecture(car.source, {_LOAD_KEY: other_w})
    again = prepare(other, cycle, Settings(allow_shortfall=True))
    return litres(car, cycle, again.certificate.bound_kg(again.problem.end_min_j)[0] - bound_kg)


def road_work_jpm(car: Architecture, cycle: Cycle) -> float:
    """Positive work at the wheels per distance, by coefficients and mass as the car's file has them.

    It shares no code with the model: Simpson's rule on the power within each step, over which speed runs straight.
    """
    file = car.contents["car"]
    mass, load = file["mass_kg"], file["road_load"]
    inertia = mass + file["wheel_inertia_kgm2"] / file["tyre_radius_m"] ** 2
    if "coastdown_c0_n" in load:
        a, b = load["coastdown_c0_n"], load["coastdown_c1_nspm"]
        c = load["coastdown_c2_ns2pm2"]
    else:
        a, b = 9.80665 * mass * load["rolling_c0"], 0.0
        c = load["air_density_kgpm3"] / 2 * load["drag_area_m2"]
    times, speeds = cycle.time_s, cycle.speed_mps
    start, end, step = speeds[:-1], speeds[1:], np.diff(times)
    accel, middle = (end - start) / step, (start + end) / 2

    def power(v: Array) -> Array:
        found: Array = (a * (v > 0) + b * v + c * v**2 + inertia * accel) * v
        return found

    work = step / 6 * (power(start) + 4 * power(middle) + power(end))
    metres = float(np.sum(step * middle))
    return float(np.sum(np.maximum(work, 0.0))) / metres
