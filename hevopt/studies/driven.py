"""A strategy's plan driven forward, beside its backward twin: what it burns, and where the two differ."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.car.handling import Handling
from hevopt.display.facts import Shown
from hevopt.driving.cycle import Cycle
from hevopt.errors import DataError
from hevopt.forward import _motor_kernels as motor
from hevopt.forward.asked import Asking, follow_asked
from hevopt.forward.breathing import EngineModel, check_engine_model
from hevopt.forward.lines import line_of
from hevopt.forward.plans import replay_of, signals_of
from hevopt.forward.run import STEP_S, ForwardRun, check_step, follow, whole_handling
from hevopt.problem.arrays import Array, Flags
from hevopt.problem.problem import Trajectory
from hevopt.strategies import strategy_named
from hevopt.studies.case import Case
from hevopt.studies.deciding import decider_of, decides
from hevopt.studies.planned import PlannedCase, planned_for
from hevopt.studies.rows import Row, is_neutral
from hevopt.studies.settings import Settings
from hevopt.studies.solved import check_horizon, run_case
from hevopt.units import litres_per_100km

# Kinds of a cycle's steps, the first that fits; and what a way counts that is shorter or longer than the trace's.
KINDS = ("standing", "launch", "change", "braking", "driving")
WAY = "distance"
_MOVES_MPS = 0.1


_ASKING = Asking()


class Manner(NamedTuple):
    """How a solved case is driven forward; the fields are those of `drive`."""

    step_s: float = STEP_S
    handling: Handling | None = None
    asking: Asking = _ASKING
    replay: bool = False
    engine_model: EngineModel = "map"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class DrivenPlan(Shown):
    """A forward run and its backward twin.

    backward: the twin's row; fuel_l_per_100km: of the way driven, starts included
    corrected_l_per_100km: less what stored energy above the asked end charge is worth, at the price of the proof
    bound_l_per_100km: least of fuel and weighted NOx of any plan that follows the cycle to the same end charge; a
    car that is driven may fall below it, as it does not follow exactly, and its engine gives its momentum back
    electricity_kwh_per_100km: stored energy that the way driven took from the battery
    difference_percent: kind of step -> forward less backward, charge-corrected, as a share of backward's; and what
    the way driven counts beside the trace's, as figures are per distance: the sum is change_percent
    Without an engine there is neither corrected fuel nor its bound, and what differs is the stored energy taken; so
    it is where neither run burns anything. difference_percent is empty where the twin took nothing to compare with.
    marks: what is to be known of the run beside its figures
    asked: how the strategy was asked on the way; None where its plan was replayed
    """

    run: ForwardRun
    strategy: str
    backward: Row
    fuel_l_per_100km: float
    electricity_kwh_per_100km: float
    corrected_l_per_100km: float | None
    bound_l_per_100km: float | None
    nox_mg_per_km: float | None
    difference_percent: Mapping[str, float]
    charge_error: float
    marks: tuple[str, ...]
    asked: Asking | None = None

    @property
    def burns(self) -> bool:
        """Whether fuel is what the run and its twin are compared by, and not the energy from the battery."""
        return _burns(self.run, self.backward)

    @property
    def change_percent(self) -> float | None:
        """Charge-corrected fuel against the backward twin's; where nothing burns the energy from the battery.

        None where the twin took none, as down a long slope.
        """
        own, twin = self.corrected_l_per_100km, self.backward.fuel_corrected_l_per_100km
        if not self.burns:
            own, twin = self.electricity_kwh_per_100km, self.backward.electricity_kwh_per_100km
        return 100 * (own / twin - 1) if own is not None and twin is not None and twin > 0 else None

    def _facts(self) -> dict[str, object]:
        return {
            "car": self.run.car.name,
            "strategy": self.strategy,
            "cycle": self.run.cycle.name,
            "fuel_l_per_100km": self.fuel_l_per_100km,
            "change_percent": self.change_percent,
            "marks": self.marks,
        }


def drive(
    car: Architecture,
    cycle: Cycle,
    strategy: str = "dp",
    *,
    settings: Settings | None = None,
    step_s: float = STEP_S,
    handling: Handling | None = None,
    asking: Asking = _ASKING,
    replay: bool = False,
    engine_model: EngineModel = "map",
) -> DrivenPlan:
    """A strategy on a car on a cycle, driven forward by a driver at the pedals.

    step_s: 0.001 to 0.1 s; handling: tyres, clutch, gear changes and driver
    asking: how often a strategy decides that can on the way; replay: its plan is driven, as that of all others and
    of a car without an engine is, which leaves nothing to decide
    engine_model: "map", or "mean_value", which drives with the air that the engine has and whose fuel counts
    A trace that is missed is driven on, and the run says where; so is one that no plan follows, as fast as one can.
    DataError for what cannot be driven forward, InfeasibleError where a plan is needed and none there.
    """
    settings = replace(settings or Settings(), allow_shortfall=True)
    check_horizon(settings.horizon_s, [strategy])
    strategy_named(strategy)
    asking.check()
    check_engine_model(car, engine_model)
    check_step(step_s, whole_handling(car, handling))
    line_of(car)
    planned = planned_for(car, cycle, settings)
    row, _, trajectory = run_case(planned.case, strategy, settings.horizon_s)
    how = Manner(step_s, handling, asking, replay, engine_model)
    return _drive(planned, cycle, strategy, settings.horizon_s, (row, trajectory), how)


def drive_solved(
    case: Case,
    strategy: str,
    horizon_s: float | None,
    solved: tuple[Row, Trajectory],
    how: Manner,
) -> DrivenPlan:
    """A case that a strategy has solved, with its row and trajectory, driven forward."""
    return _drive(PlannedCase(case), case.cycle, strategy, horizon_s, solved, how)


def _drive(
    planned: PlannedCase, cycle: Cycle, strategy: str, horizon_s: float | None, solved: tuple[Row, Trajectory],
    how: Manner,
) -> DrivenPlan:  # fmt: skip
    case, (row, trajectory) = planned.case, solved
    car, line = case.car, line_of(case.car)
    asked = None
    if how.replay or not decides(strategy) or car.electric:
        plan = replay_of(trajectory, line)
        run = follow(
            car, case.cycle, plan, step_s=how.step_s, handling=how.handling, line=line,
            engine_model=how.engine_model,
        )  # fmt: skip
    else:
        decider = decider_of(case, strategy, horizon_s, how.asking)
        asked = decider.asking
        run = follow_asked(
            car, case.cycle, decider, trajectory,
            step_s=how.step_s, handling=how.handling, line=line, engine_model=how.engine_model,
        )  # fmt: skip
    run = run.against(cycle)
    _check_moved(run)
    found = beside(case, strategy, row, trajectory, run, asked=asked)
    return replace(found, marks=planned.marks + found.marks)


def beside(
    case: Case,
    strategy: str,
    row: Row,
    trajectory: Trajectory,
    run: ForwardRun,
    *,
    asked: Asking | None = None,
) -> DrivenPlan:
    """A forward run held against the trajectory that it replays, or that its strategy drives backward."""
    car, end_j = run.car, float(run.energy_j[-1])
    price, surplus_j = case.certificate.price_kgpj, end_j - case.problem.end_min_j

    def litres(mass_kg: float) -> float:
        return litres_per_100km(mass_kg, car.engine.fuel_density_kgpm3, run.distance_m)

    km = run.distance_m / 1e3
    taken_j = float(run.energy_j[0]) - end_j
    return DrivenPlan(
        run,
        strategy,
        row,
        litres(run.fuel_kg),
        taken_j / 3.6e6 / km * 100,
        None if car.electric else litres(run.fuel_kg - price * surplus_j),
        None if car.electric else litres(case.certificate.bound_kg(end_j)[0]),
        run.nox_kg * 1e6 / km if car.engine.nox_known else None,
        _difference(trajectory, run, price if _burns(run, row) else None),
        float(run.soc[-1] - np.interp(run.time_s[-1], case.cycle.time_s, trajectory.soc)),
        _marks(case, run, surplus_j),
        asked,
    )


def _burns(run: ForwardRun, twin: Row) -> bool:
    burnt = run.fuel_kg > 0 or (twin.fuel_l_per_100km or 0.0) > 0
    return burnt and not run.car.electric


def _check_moved(run: ForwardRun) -> None:
    moved = run.speed_mps.max()
    if moved < _MOVES_MPS <= run.wanted_mps.max():
        k = int(np.argmax(run.wanted_mps > _MOVES_MPS))
        raise DataError(
            f"{run.car.name}: the car does not move off at t = {run.time_s[k]:g} s of {run.cycle.name}: engine, "
            "clutch and tyres give less than mass and slope take; check mass, first gear, grade and clutch"
        )


def _marks(case: Case, run: ForwardRun, surplus_j: float) -> tuple[str, ...]:
    pack, marks = run.car.battery, []
    if count := len(run.quality.violations):
        marks.append(f"trace missed {count} time{'s' if count > 1 else ''}")
    fuel_j = run.fuel_kg * run.car.engine.heating_value_jpkg
    # What a car without an engine has left above what is asked is what it is driven for.
    if not is_neutral(surplus_j, fuel_j) and not (run.car.electric and surplus_j > 0):
        marks.append("end charge off by more than 1 %")
    slack = 1e-4 * (pack.soc_max - pack.soc_min)
    if run.soc.min() < pack.soc_min - slack or run.soc.max() > pack.soc_max + slack:
        marks.append("charge left its window")
    if run.books.off_map.any():
        marks.append(f"outside a measured map for {run.books.off_map.sum() * run.step_s:.1f} s")
    return tuple(marks)


def _difference(
    trajectory: Trajectory, run: ForwardRun, price_kgpj: float | None
) -> dict[str, float]:
    """Charge-corrected fuel, forward less backward, by kind of step and way, in per cent of the backward one's.

    price_kgpj: what a joule taken from the battery counts; None where nothing burns and that energy is compared
    Nothing where the backward one is none.
    """
    asked_j = trajectory.problem.end_min_j
    if price_kgpj is None:
        price_kgpj, asked_j = 1.0, float(trajectory.energy_j[0])
    total = trajectory.total_fuel_kg - price_kgpj * (trajectory.end_j - asked_j)
    if total <= 0:
        return {}
    table, flows, books = trajectory.problem.table, trajectory.flows, run.books.flows
    times = np.append(table.time_s, table.time_s[-1] + table.step_s[-1])

    def per_step(rate: Array) -> Array:
        summed = np.append(0.0, np.cumsum(rate)) * run.step_s
        return np.diff(np.interp(times, run.time_s, summed))

    # Fuel that no map knows counts as little here as in the whole.
    burnt = np.nan_to_num(books["fuel_kgps"])
    forward = per_step(burnt + price_kgpj * np.nan_to_num(books["battery_chemical_w"]))
    starts = np.diff((run.engine == motor.STARTING).astype(float), prepend=0.0) > 0
    forward += per_step(starts / run.step_s) * run.car.engine.start_fuel_kg
    drained_j = flows["battery_chemical_w"] * table.step_s + trajectory.switch_energy_j
    backward = trajectory.fuel_kg + price_kgpj * drained_j
    kinds = kinds_of(trajectory, run, times)
    gap = 100 * (forward - backward) / total
    found = {kind: float(np.sum(gap[kinds == n])) for n, kind in enumerate(KINDS)}
    per_way = float(np.sum(signals_of(table).speed_mps * table.step_s)) / run.distance_m
    return found | {WAY: (100 + float(np.sum(gap))) * (per_way - 1)}


def kinds_of(trajectory: Trajectory, run: ForwardRun, times: Array) -> Array:
    """(time,) number of each step's kind."""
    signals = signals_of(trajectory.problem.table)
    books = run.books.flows

    def anywhere(where: Flags) -> Flags:
        summed = np.append(0.0, np.cumsum(where))
        found: Flags = np.diff(np.interp(times, run.time_s, summed)) > 0.01
        return found

    changes = np.diff(run.gear, prepend=run.gear[0]) != 0
    moving = books["speed_mps"] > 0
    tests = (
        signals.speed_mps == 0,
        anywhere(
            np.abs(books["clutch_launch_w"]) + books.get("torque_converter_launch_w", 0.0) > 0
        ),
        anywhere(changes & moving),
        signals.wheel_power_w < 0,
        np.ones(len(signals.speed_mps), dtype=bool),
    )
    return np.select(tests, range(len(KINDS)))
