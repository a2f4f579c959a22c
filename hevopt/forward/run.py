"""A car driven along a trace by a driver at the pedals, engine and gears by a plan."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.car.handling import Clutch, DriverGains, Handling, Shifting, Tyre
from hevopt.display.facts import Shown
from hevopt.driving.cycle import Cycle
from hevopt.errors import DataError
from hevopt.forward import _drive_kernels as col
from hevopt.forward import _motor_kernels as motor
from hevopt.forward._acting_kernels import LoopCar, LoopTask
from hevopt.forward._contact_kernels import Body
from hevopt.forward.books import Books, books_of
from hevopt.forward.breathing import EngineModel
from hevopt.forward.limits import beside_of, limits_of
from hevopt.forward.lines import Line, line_of
from hevopt.forward.loads import loads_at, loads_w
from hevopt.forward.loops import Driving
from hevopt.forward.plans import ForwardPlan
from hevopt.forward.quality import DriveQuality, drive_quality
from hevopt.forward.stability import check_gains
from hevopt.problem.arrays import Array, Indices
from hevopt.problem.battery import energy_j

_Part = TypeVar("_Part", Tyre, Clutch, Shifting, DriverGains)
STEP_S = 0.01
STEP_RANGE_S = (0.001, 0.1)
STEPS_MAX = 20_000_000


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ForwardRun(Shown):
    """A driven trace; (step,) but for what is a state: time_s, speed_mps, wanted_mps, energy_j, soc, (step + 1,).

    gear: the one listed; engine: 0 at rest, 1 started, 2 turning, 3 stopped
    plan_j: (time + 1,) stored energy of the plan over the cycle
    full: engine and machine give all, and it is too little
    starts, start_fuel_kg: of the engine, and what they count
    """

    car: Architecture
    cycle: Cycle
    step_s: float
    handling: Handling
    time_s: Array
    speed_mps: Array
    wanted_mps: Array
    gear: Indices
    engine: Indices
    full: np.ndarray
    books: Books
    plan_j: Array
    quality: DriveQuality
    starts: int
    start_fuel_kg: float

    @property
    def fuel_kg(self) -> float:
        """Fuel burnt, starts included."""
        return float(np.nansum(self.books.flows["fuel_kgps"])) * self.step_s + self.start_fuel_kg

    @property
    def against_map_percent(self) -> float | None:
        """Fuel of the mean-value engine against the steady map's at the same torques and speeds; None by the map.

        Steps outside a measured map, of which that knows no fuel, are left out.
        """
        flows = self.books.flows
        if "map_fuel_kgps" not in flows:
            return None
        known = np.isfinite(flows["map_fuel_kgps"])
        by_map = float(np.sum(flows["map_fuel_kgps"][known]))
        own = float(np.sum(flows["fuel_kgps"][known]))
        return 100 * (own / by_map - 1) if by_map > 0 else None

    @property
    def nox_kg(self) -> float:
        """NOx emitted."""
        return float(np.nansum(self.books.flows["nox_kgps"])) * self.step_s

    @property
    def distance_m(self) -> float:
        """Distance driven."""
        return float(np.sum(self.books.flows["speed_mps"])) * self.step_s

    @property
    def energy_j(self) -> Array:
        """(step + 1,) stored energy."""
        return self.books.energy_j

    @property
    def soc(self) -> Array:
        """(step + 1,) state of charge."""
        return self.books.soc

    @property
    def planned_j(self) -> Array:
        """(step + 1,) stored energy of the plan."""
        planned_j: Array = np.interp(self.time_s, self.cycle.time_s, self.plan_j)
        return planned_j

    @property
    def missed(self) -> bool:
        """Whether the trace was left by more than its tolerance."""
        return bool(self.quality.violations)

    @property
    def residual(self) -> Mapping[str, float]:
        """Component -> energy that does not add up, largest sum over the run, as a share of its throughput."""
        flows, found = self.books.flows, {}
        through = float(np.abs(flows["wheel_power_w"]).sum() + np.abs(flows["road_w"]).sum())
        for name, values in self.books.residuals.items():
            found[name] = float(np.abs(values).sum()) / max(through, 1e-9)
        return found

    def against(self, cycle: Cycle) -> "ForwardRun":
        """The run held against another trace of the same times, of which the driver followed what he could."""
        if cycle is self.cycle:
            return self
        wanted = np.interp(self.time_s, cycle.time_s, cycle.speed_mps)
        quality = drive_quality(self.car.vehicle, self.time_s, self.speed_mps, wanted)
        return replace(self, cycle=cycle, wanted_mps=wanted, quality=quality)

    def _facts(self) -> dict[str, object]:
        return {
            "car": self.car.name,
            "cycle": self.cycle.name,
            "fuel_kg": self.fuel_kg,
            "soc_end": float(self.soc[-1]),
            "rmsse_kmh": 3.6 * self.quality.speed_error_mps,
            "violations": len(self.quality.violations),
        }


def shifting_of(car: Architecture) -> Shifting:
    """How its files have this car change gear."""
    return car.handling.shifting or Shifting(gap_s=car.shift_gap_s)


def follow(
    car: Architecture,
    cycle: Cycle,
    plan: ForwardPlan,
    *,
    step_s: float = STEP_S,
    handling: Handling | None = None,
    line: Line | None = None,
    engine_model: EngineModel = "map",
) -> ForwardRun:
    """The car driven along the cycle, engine and gears as planned.

    step_s: 0.001 to 0.1 s, shortened so that a whole number of steps fills the cycle; line: `line_of(car)`
    engine_model: "map", or "mean_value", whose air limits the torque, and whose fuel counts
    A trace that cannot be followed is driven on; the run's `quality` says where it was left. DataError for a step
    or a figure out of range, a driveline that cannot be driven forward, and a battery that empties on the way.
    """
    line, handling = line or line_of(car), whole_handling(car, handling)
    exact_s, record = steps_of(cycle, step_s, handling, len(car.machines))
    task = task_of(car, cycle, plan, cycle.time_s)
    driven = loop_car(car, line, handling, task.load_w)
    start_mps = float(cycle.speed_mps[0])
    driving = Driving(car, line, start_mps, driven, task, plan.course, engine_model)
    driving.advance(driving.begun(float(plan.energy_j[0])), 0, record, exact_s)
    return run_of(car, cycle, task, plan.energy_j, line, handling, record, exact_s, driving)


def whole_handling(car: Architecture, handling: Handling | None) -> Handling:
    """Handling, of the car's files where none is given, with how this car changes gear."""
    handling = handling or car.handling
    return handling._replace(shifting=handling.shifting or shifting_of(car))


def steps_of(
    cycle: Cycle, step_s: float, handling: Handling, machines: int = 1
) -> tuple[float, Array]:
    """Length of the steps, so that they fill the cycle, and the empty record; DataError as `follow` says."""
    _check(cycle, step_s, handling)
    count = int(np.ceil(cycle.duration_s / step_s - 1e-9))
    return cycle.duration_s / count, np.zeros((count, col.COLUMNS + machines - 1))


def loop_car(
    car: Architecture, line: Line, handling: Handling, load_w: Array | None = None
) -> LoopCar:
    """A car as the compiled loops read it; handling: that of `whole_handling`; load_w: as of a LoopTask."""
    if handling.tyre.slips and line.free is not None:
        raise DataError(
            f"{car.name}: tyres that slip are for an engine behind clutch and gears, or none; leave "
            'law = "pacejka" out'
        )
    shifting = handling.shifting or shifting_of(car)
    vehicle, pack = car.vehicle, car.battery
    body = Body(
        float(vehicle.mass_kg), float(vehicle.equivalent_mass_kg), float(vehicle.tyre_radius_m),
        _four(vehicle.rolling_n), _four(vehicle.air_n), _floats(handling.tyre),
        _floats(handling.clutch),
    )  # fmt: skip
    loads = None if load_w is None else (float(load_w.min()), float(load_w.max()))
    low, high = (float(energy_j(pack, end)) for end in (pack.soc_min, pack.soc_max))
    others = () if line.free is not None else line.order[1:]
    return LoopCar(body, line.ways, line.fast_way, line.fast_radps, limits_of(car, loads, line.order[0]),
                   beside_of(car, others, loads), pack.arrays, (low, high), _floats(shifting),
                   _floats(handling.driver))  # fmt: skip


def _floats(part: _Part) -> _Part:
    """One type for the compiled loop, whatever was given."""
    return type(part)(*map(float, part))  # type: ignore[arg-type]


def _four(values: tuple[float, ...]) -> tuple[float, float, float, float]:
    a, b, c, d = map(float, values)
    return a, b, c, d


def task_of(car: Architecture, cycle: Cycle, plan: ForwardPlan, from_s: Array) -> LoopTask:
    """A trace and its plan as the compiled loop reads them; from_s: (step + 1,) times of the plan's steps."""

    def own(values: Array) -> Array:
        return np.array(values, dtype=np.float64)

    return LoopTask(
        own(cycle.time_s), own(cycle.speed_mps), np.arctan(own(cycle.grade[:-1])), loads_w(car, cycle),
        own(from_s), plan.way,
        plan.engine_on, plan.open_while, plan.machine_nm, plan.energy_j, plan.others_nm,
    )  # fmt: skip


def starts_of(phase: Indices, before: int) -> int:
    """How often the engine was started; phase: (step,) of the engine; before: that of the step before the first."""
    starting = np.append(before, phase) == motor.STARTING
    return int(np.sum(starting[1:] & ~starting[:-1]))


def run_of(
    car: Architecture, cycle: Cycle, task: LoopTask, planned_j: Array, line: Line, handling: Handling,
    record: Array, step_s: float, driving: Driving,
) -> ForwardRun:  # fmt: skip
    """What a loop has recorded, judged; planned_j: (time + 1,) stored energy that was planned over the cycle."""
    start_mps, on = float(cycle.speed_mps[0]), bool(task.engine_on[0])
    side = driving.start_radps if on else 0.0
    breath = None if driving.breathing is None else driving.breathing.breath
    time_s = cycle.time_s[0] + step_s * np.arange(len(record) + 1)
    start = start_mps, side, float(planned_j[0])
    load_w = loads_at(task, time_s[:-1])
    books = books_of(car, line, record, start, step_s, load_w, breath, slips=handling.tyre.slips)
    check_charge(car, books, record, time_s)
    said = books.recorded
    speed = np.append(start_mps, said.speed_mps)
    wanted = np.interp(time_s, cycle.time_s, cycle.speed_mps)
    starts = starts_of(said.engine, motor.REST)
    return ForwardRun(
        car, cycle, step_s, handling, time_s, speed, wanted, line.gears[said.way], said.engine, said.full,
        books, planned_j, drive_quality(car.vehicle, time_s, speed, wanted), starts,
        starts * car.engine.start_fuel_kg,
    )  # fmt: skip


def _check(cycle: Cycle, step_s: float, handling: Handling) -> None:
    check_step(step_s, handling)
    if cycle.duration_s / step_s > STEPS_MAX:
        raise DataError(
            f"cycle {cycle.name}: {cycle.duration_s / step_s:.3g} steps of {step_s:g} s; allowed: {STEPS_MAX:g}; "
            "choose a longer step"
        )


def check_step(step_s: float, handling: Handling) -> None:
    """DataError for a step or a figure out of range, and for gains that do not go with the step."""
    low, high = STEP_RANGE_S
    if not low <= step_s <= high:  # nor NaN
        raise DataError(f"step {step_s:g} s; allowed: {low:g} to {high:g} s")
    handling.check()
    check_gains(handling.driver, handling.tyre, step_s)


def check_charge(car: Architecture, books: Books, record: Array, time_s: Array) -> None:
    """DataError where the battery is empty, or its power too little; record: of the loop; time_s: (step + 1,)."""
    # What is lost once stays lost.
    if books.energy_j.min() >= 0 and np.isfinite(record[-1, col.ENERGY]):
        return
    # Outside a measured map no energy is known either, and that is told with the run; the loop's own has no end.
    beyond = ~np.isfinite(books.energy_j) & ~books.off_map.any()
    beyond[1:] |= ~np.isfinite(record[:, col.ENERGY])
    lost = beyond | (books.energy_j < 0)
    if lost.any():
        first = int(np.argmax(lost))
        said = "cannot give the power that is asked of it" if beyond[first] else "is empty"
        raise DataError(
            f"{car.name}: the battery {said} at t = {time_s[first]:g} s; raise soc_start, choose a larger battery "
            "or a lower electric load"
        )
