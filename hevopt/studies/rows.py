"""Rows: the figures of one architecture and strategy, made of a case and a trajectory, and their reference."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from hevopt.bounds.claim import Claim
from hevopt.car.architecture import Architecture
from hevopt.display.facts import Shown
from hevopt.errors import HevoptError
from hevopt.files.shown import printable
from hevopt.problem.problem import Problem, Trajectory
from hevopt.studies.status import Mark, Status

if TYPE_CHECKING:
    from hevopt.studies.case import Case

NEUTRAL_PERCENT = 1.0
REFERENCE_ARCHITECTURE = "A"
# A percentage of less than this is none: the figure it would stand beside is rounding.
_TINY = 1e-9
_ROUNDING_J = 1.0


@dataclass(frozen=True, slots=True, repr=False)
class Row(Shown):
    """One architecture and strategy. None where a case failed, or where there is nothing to compare with:
    no reference, no fuel, or a bound of 0; bound and corrected fuel of a car without an engine, whose gap is that
    of its electricity at the battery's terminals; of NOx also where the engine has no data on it.

    status: its marks, or why it has no figures
    delta_energy_percent: stored energy at the end above what is asked, as a share of the fuel's;
    electricity_kwh_per_100km: stored energy that the drive took from the battery, start less end
    fuel_corrected_l_per_100km: fuel less what the surplus is worth
    bound_l_per_100km: least of fuel + weighted NOx that any plan with this row's end charge could reach,
    as fuel volume; gap_percent: this row's own sum above it
    """

    architecture: str
    strategy: str
    status: Status
    fuel_l_per_100km: float | None = None
    delta_fuel_percent: float | None = None
    co2_g_per_km: float | None = None
    nox_mg_per_km: float | None = None
    delta_nox_percent: float | None = None
    soc_start: float | None = None
    soc_end: float | None = None
    delta_energy_percent: float | None = None
    electricity_kwh_per_100km: float | None = None
    fuel_corrected_l_per_100km: float | None = None
    engine_starts: int | None = None
    bound_l_per_100km: float | None = None
    gap_percent: float | None = None
    certificate: Claim | None = None
    solve_s: float | None = None

    @property
    def solved(self) -> bool:
        """Whether there are figures: the case did not fail."""
        return self.fuel_l_per_100km is not None

    @property
    def electric(self) -> bool:
        """Whether it is of a car without an engine: nothing is burnt, and no charge is worth fuel."""
        return self.solved and self.fuel_corrected_l_per_100km is None

    def _facts(self) -> dict[str, object]:
        names = "architecture", "strategy", "fuel_l_per_100km", "bound_l_per_100km"
        return {
            **{name: getattr(self, name) for name in names},
            "gap_percent": None if self.gap_percent is None else round(self.gap_percent, 6),
            "proof": None if self.certificate is None else str(self.certificate.proof),
            "status": str(self.status),
        }

    def as_dict(self) -> dict[str, Any]:
        """All fields by name, in order, as JSON has them: status and certificate as text."""
        certificate = None if self.certificate is None else str(self.certificate)
        texts = {"status": str(self.status), "certificate": certificate}
        return {f.name: getattr(self, f.name) for f in fields(self)} | texts


def row_of(case: "Case", strategy: str, trajectory: Trajectory, solve_s: float) -> Row:
    """The row of what a strategy does on a case, no reference yet."""
    from hevopt.studies.case import litres

    car, cycle, problem, certificate = case.car, case.cycle, case.problem, case.certificate
    fuel_kg, km = trajectory.total_fuel_kg, cycle.distance_m / 1e3
    surplus_j = trajectory.end_j - problem.end_min_j
    fuel_j = fuel_kg * car.engine.heating_value_jpkg
    bound_kg, proof = certificate.bound_of(trajectory)
    corrected_kg = fuel_kg - certificate.price_kgpj * surplus_j

    return Row(
        architecture=car.name,
        strategy=strategy,
        status=_status(problem, surplus_j, fuel_j, electric=car.electric),
        fuel_l_per_100km=litres(car, cycle, fuel_kg),
        co2_g_per_km=fuel_kg * car.engine.co2_kgpkg * 1e3 / km,
        nox_mg_per_km=trajectory.total_nox_kg * 1e6 / km if car.engine.nox_known else None,
        soc_start=problem.soc_start,
        soc_end=float(trajectory.soc[-1]),
        delta_energy_percent=_percent(surplus_j, fuel_j),
        electricity_kwh_per_100km=(problem.start_j - trajectory.end_j) / 3.6e6 / km * 100,
        fuel_corrected_l_per_100km=None if car.electric else litres(car, cycle, corrected_kg),
        engine_starts=engine_starts(problem, trajectory),
        bound_l_per_100km=None if car.electric else litres(car, cycle, bound_kg),
        gap_percent=_percent(trajectory.cost_kg - bound_kg, abs(bound_kg)),
        certificate=certificate.claim(proof),
        solve_s=solve_s,
    )


def failed_row(car: Architecture, strategy: str, error: HevoptError) -> Row:
    """The row of a strategy that has no figures."""
    return Row(car.name, strategy, Status(failure=error.headline))


def against_reference(rows: list[Row]) -> tuple[list[Row], str | None]:
    """Rows with their change against a solved row of architecture A, or of the whole table where A is not in it:
    the first that is ok, or else the first. No change where there is none.
    """
    named = [row for row in rows if row.architecture == REFERENCE_ARCHITECTURE]
    candidates = [row for row in named or rows if row.solved]
    if not candidates:
        return rows, None
    base = next((row for row in candidates if row.status.ok), candidates[0])

    def change(value: float | None, reference: float | None) -> float | None:
        if value is None or reference is None or reference < _TINY:
            return None
        return 100 * (value / reference - 1)

    changed = [
        replace(
            row,
            delta_fuel_percent=change(row.fuel_l_per_100km, base.fuel_l_per_100km),
            delta_nox_percent=change(row.nox_mg_per_km, base.nox_mg_per_km),
        )
        for row in rows
    ]
    return changed, f"{base.architecture} {base.strategy}"


def no_reference_text(rows: Iterable[Row]) -> str:
    """Why no row is compared with another."""
    solved = {row.architecture: False for row in rows}
    solved |= {row.architecture: True for row in rows if row.solved}
    if not any(solved.values()):
        return "nothing, every row failed"
    if solved.get(REFERENCE_ARCHITECTURE, True):
        return "nothing, a single run"
    return (
        f"nothing, as no row of {REFERENCE_ARCHITECTURE} was solved (--allow-shortfall drives on where a step "
        "cannot be followed)"
    )


def end_asked_text(end_asked: Mapping[str, float]) -> str:
    """The end charges asked, each with its cars: "0.5 in A, B; 0.58 in C2"."""
    cars: dict[float, list[str]] = {}
    for car, soc in end_asked.items():
        cars.setdefault(soc, []).append(printable(car))
    return "; ".join(f"{soc:g} in {', '.join(names)}" for soc, names in cars.items())


def _status(problem: Problem, surplus_j: float, fuel_j: float, *, electric: bool) -> Status:
    charge = None
    # What a car without an engine has left above what is asked is what it is driven for.
    if not is_neutral(surplus_j, fuel_j) and not (electric and surplus_j > 0):
        missed = Mark.CHARGE_ABOVE if surplus_j > 0 else Mark.CHARGE_MISSED
        charge = Mark.NOT_NEUTRAL if problem.end_min_j == problem.start_j else missed
    return Status(charge, shortfall_steps(problem))


def is_neutral(surplus_j: float, fuel_j: float) -> bool:
    """Whether the charge at the end is that asked, within 1 % of the fuel's energy."""
    return 100 * abs(surplus_j) <= max(NEUTRAL_PERCENT * fuel_j, 100 * _ROUNDING_J)


def marked(status: Status) -> str:
    """What to add to the name of a row that others are compared with: nothing, or its marks."""
    return "" if status.ok else f", itself marked {status}"


def shortfall_steps(problem: Problem) -> int:
    """Number of steps driven with less than the cycle asks."""
    missing = problem.table.missing_torque_nm
    return 0 if missing is None else int((missing > 0).sum())


def engine_starts(problem: Problem, trajectory: Trajectory) -> int:
    """How often the engine goes from rest to turning."""
    of_control = np.array([control.engine_on for control in problem.table.controls])
    on = of_control[trajectory.control]
    start_on = any(
        control.engine_on
        for control, mode in zip(problem.table.controls, problem.table.mode, strict=True)
        if mode == problem.start_mode
    )
    return int(np.sum(on & ~np.append(start_on, on[:-1])))


def _percent(part: float, whole: float) -> float | None:
    return 100 * part / whole if whole > _TINY else None
