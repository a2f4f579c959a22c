"""From solved cases to Results: give `Collector.observe` to `study.compare`, then ask for the results."""

from collections.abc import Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hevopt.car.architecture import Architecture
from hevopt.driving.cycle import Cycle
from hevopt.errors import DataError
from hevopt.files.lookup import without_folders
from hevopt.pages.comparison.about import about_car
from hevopt.pages.comparison.energy import energy_of
from hevopt.pages.comparison.maps import engine_map, machine_map
from hevopt.pages.comparison.operation import (
    OPERATIONS,
    engine_on,
    limits_touched,
    operations_of,
    shares_of,
    spells_s,
)
from hevopt.pages.comparison.results import (
    Detail,
    PublishedFigure,
    Results,
    RowFigures,
    SavedMember,
    SavedRow,
    SavedTrace,
)
from hevopt.pages.comparison.saved_car import CarFigures
from hevopt.problem.problem import Plan, Trajectory
from hevopt.problem.simulation import simulate
from hevopt.reproduction.published import published_beside
from hevopt.strategies import STRATEGIES
from hevopt.studies.case import Case, litres
from hevopt.studies.comparison import Comparison
from hevopt.studies.provenance import digests_shown, files_digests, versions
from hevopt.studies.rows import Row as StudyRow
from hevopt.studies.rows import is_neutral

# Decimals of traces: finer than any of them is known.
_DIGITS = {
    "soc": 7, "fuel_kg": 9, "nox_kg": 12, "battery_power_w": 1, "engine_torque_nm": 3, "engine_speed_radps": 3,
    "machine_torque_nm": 3, "machine_speed_radps": 3, "wheel_power_w": 1, "speed_mps": 5,
    "missing_torque_nm": 3,
}  # fmt: skip

# Longer cycles make pages that a browser cannot hold.
STEPS_MAX = 20_000


def check_steps(cycle: Cycle) -> None:
    """DataError where a cycle is too long for a page."""
    steps = len(cycle.time_s) - 1
    if steps > STEPS_MAX:
        raise DataError(
            f"cycle {cycle.name} has {steps} steps; allowed for --report and --save: up to {STEPS_MAX}; choose "
            "a shorter or a coarser one"
        )


class Collector:
    """Keeps of every solved case what its page needs, while the study runs."""

    def __init__(self) -> None:
        self._read: dict[str, tuple[Architecture, Cycle]] = {}
        self._cars: dict[str, CarFigures] = {}
        self._details: dict[tuple[str, str], Detail] = {}

    def observe(self, case: Case, row: StudyRow, plan: Plan, trajectory: Trajectory) -> None:
        """Take in one row; nothing of the case's tables is kept."""
        name = case.car.name
        if name not in self._cars:
            self._read[name], self._cars[name] = (case.car, case.cycle), _car(case)
        self._details[name, row.strategy] = _detail(case, plan, trajectory)

    def results(
        self,
        comparison: Comparison,
        command: str,
        *,
        changes: Sequence[str] = (),
        others: Sequence[Path] = (),
        published: bool = True,
    ) -> Results:
        """The results of a comparison whose cases were observed.

        command: repeats it; changes: lines saying what of the cars' files was changed or left out
        others: files read beside those of cars and cycle; published: whether the cars are those of the study
        """
        cars = [car for car, _ in self._read.values()]
        cycles = [cycle for _, cycle in self._read.values()][:1]
        return Results(
            cycle=comparison.cycle,
            distance_m=cycles[0].distance_m if cycles else 0.0,
            reference=comparison.reference,
            nox_weight=comparison.nox_weight,
            free_gear=comparison.free_gear,
            end_asked=dict(comparison.end_asked),
            command=without_folders(command),
            changes=[without_folders(line) for line in changes],
            inputs=digests_shown(files_digests(cars, cycles, others)),
            versions=versions(),
            operations=list(OPERATIONS),
            causal=[name for name, strategy in STRATEGIES.items() if strategy.causal]
            + sorted(comparison.causal - STRATEGIES.keys()),
            cars=self._cars,
            rows=[
                SavedRow(
                    figures=RowFigures.model_validate(row.as_dict()),
                    detail=self._details.get((row.architecture, row.strategy)),
                )
                for row in comparison.rows
            ],
            failures={
                name: without_folders(str(error)) for name, error in comparison.failures.items()
            },
            peeking=comparison.peeking_by_row,
            lost_proofs={
                name: without_folders(why) for name, why in comparison.lost_proofs.items()
            },
            published=[
                PublishedFigure(**statement._asdict())
                for statement in (published_beside(comparison) if published else [])
            ],
        )


def _car(case: Case) -> CarFigures:
    car, table, signals = case.car, case.problem.table, case.problem.table.signals
    rollout = simulate(case.problem, case.dp_plan.control)
    bound_kg, _ = case.certificate.bound_of(rollout)
    missing = table.missing_torque_nm
    missing = np.zeros(len(table.time_s)) if missing is None else missing
    return CarFigures(
        name=car.name,
        time_s=table.time_s.tolist(),
        step_s=table.step_s.tolist(),
        speed_mps=_rounded("speed_mps", signals.speed_mps),
        wheel_power_w=_rounded("wheel_power_w", signals.wheel_power_w),
        missing_torque_nm=_rounded("missing_torque_nm", missing),
        soc_min=case.problem.battery.soc_min,
        soc_max=case.problem.battery.soc_max,
        heating_value_jpkg=car.engine.heating_value_jpkg,
        price_kgpj=float(case.certificate.price_kgpj),
        certified_gap_percent=(
            float(100 * (rollout.cost_kg - bound_kg) / bound_kg) if bound_kg > 0 else None
        ),
        engine=engine_map(car),
        about=about_car(car, case.cycle),
        machine=machine_map(
            car,
            float(np.max(table.flows["machine_speed_radps"][table.feasible], initial=0.0)),
            float(np.max(np.abs(table.flows["machine_torque_nm"][table.feasible]), initial=0.0)),
        ),
    )


def _detail(case: Case, plan: Plan, trajectory: Trajectory) -> Detail:
    table, step_s = case.problem.table, case.problem.table.step_s
    operation, on = operations_of(trajectory, table), engine_on(trajectory, table)
    on_s, off_s = spells_s(on, step_s)
    price = plan.notes.get("price_kgpj")
    return Detail(
        trace=_trace(case, trajectory, operation),
        energy=energy_of(trajectory, step_s, case.car.engine.heating_value_jpkg),
        shares=shares_of(trajectory, table, operation, nox_known=case.car.engine.nox_known),
        limits=limits_touched(case.car, case.problem, trajectory),
        engine_on_s=on_s,
        engine_off_s=off_s,
        equivalence_kgpj=None if price is None else float(price),
        calibration=_calibration(case, plan.notes),
        solver=_trouble(plan.notes),
    )


def _trace(case: Case, trajectory: Trajectory, operation: NDArray) -> SavedTrace:
    table, flows = case.problem.table, trajectory.flows
    labels = [table.controls[c] for c in trajectory.control]
    listed = table.signals.gear.tolist()
    values = {
        name: flows[name] for name in _DIGITS if name in flows and name in SavedTrace.model_fields
    }
    values |= {
        "soc": trajectory.soc,
        "fuel_kg": trajectory.fuel_kg,
        "nox_kg": trajectory.nox_kg,
        "battery_power_w": trajectory.battery_power_w,
    }
    return SavedTrace(
        operation=operation.tolist(),
        engine_gear=[label.engine_gear or gear for label, gear in zip(labels, listed, strict=True)],
        machine_gear=[label.machine_gear for label in labels],
        **{name: _rounded(name, value) for name, value in values.items()},
    )


def _calibration(case: Case, notes: Mapping[str, Any]) -> list[SavedMember]:
    members: Sequence[Mapping[str, Any]] = notes.get("calibration", [])
    if len(members) < 2:
        return []
    distance_m = case.cycle.distance_m
    weight, engine = case.problem.nox_weight, case.car.engine

    return [
        SavedMember(
            threshold_w=member["threshold_w"],
            threshold_mps=member["threshold_mps"] if isfinite(member["threshold_mps"]) else None,
            threshold_soc=member["threshold_soc"],
            nox_cap_kgps=member.get("nox_cap_kgps"),
            corrected_l_per_100km=litres(case.car, case.cycle, member["corrected_kg"]),
            nox_mg_per_km=member["nox_kg"] * 1e9 / distance_m if engine.nox_known else None,
            surplus_j=member["surplus_j"],
            neutral=bool(member["inside"])
            and is_neutral(
                member["surplus_j"],
                engine.heating_value_jpkg * (member["cost_kg"] - weight * member["nox_kg"]),
            ),
            chosen=n == notes["chosen"],
        )
        for n, member in enumerate(members)
    ]


def _trouble(notes: Mapping[str, Any]) -> list[str]:
    fallbacks = notes.get("fallbacks", 0)
    found = []
    if fallbacks:
        found.append(f"{fallbacks} previews solved by the second solver")
    if notes.get("settled") is False:
        found.append("the policy's values had not settled")
    return found


def _rounded(name: str, values: NDArray[np.float64]) -> list[float]:
    # Adding 0 turns -0.0 into 0.0.
    return (np.round(values, _DIGITS[name]) + 0.0).tolist()
