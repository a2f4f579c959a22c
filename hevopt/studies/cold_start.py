"""What rows burn when the engine starts cold: a correction after the solution, unknown to strategies and bounds."""

from dataclasses import asdict, dataclass

import numpy as np

from hevopt.car.source import SourceLaw
from hevopt.car.warming import START_C, check_start, warmed
from hevopt.display.facts import Shown
from hevopt.problem.problem import Plan, Trajectory
from hevopt.studies.case import Case, litres
from hevopt.studies.rows import Row

_NEARLY_HOT_K = 5.0


@dataclass(frozen=True, slots=True, repr=False)
class ColdFigures(Shown):
    """A row from a cold start.

    warm_l_per_100km: the row's own fuel; cold_l_per_100km, added_percent: with what the cold engine burns more
    coolant_end_c: temperature at the end; warm_after_s: when it is within 5 K of hot first, None for never
    """

    warm_l_per_100km: float
    cold_l_per_100km: float
    added_percent: float
    coolant_end_c: float
    warm_after_s: float | None

    def as_dict(self) -> dict[str, float | None]:
        """All fields by name, in order."""
        return asdict(self)

    def _facts(self) -> dict[str, object]:
        return dict(self.as_dict())


class ColdStarts:
    """Takes the figures of every solved row whose engine warms up: neither electric cars' nor those of a source.

    start_c: coolant's and ambient temperature at the start; figures: car and strategy -> figures
    Raises DataError for a start that the fuel factor does not cover.
    """

    def __init__(self, start_c: float) -> None:
        check_start(start_c)
        self.start_c = start_c
        self.figures: dict[tuple[str, str], ColdFigures] = {}

    def observe(self, case: Case, row: Row, plan: Plan, trajectory: Trajectory) -> None:
        """Take a solved case."""
        warms = not isinstance(case.car.engine.law, SourceLaw)
        if warms and trajectory.total_fuel_kg > 0:
            self.figures[row.architecture, row.strategy] = cold_figures(
                case, trajectory, self.start_c
            )


def cold_figures(case: Case, trajectory: Trajectory, start_c: float) -> ColdFigures:
    """The correction of one row; fuel of starts and shifts is a cold engine's too."""
    flows, step_s = trajectory.flows, case.problem.table.step_s
    work_j = flows["engine_torque_nm"] * flows["engine_speed_radps"] * step_s
    coolant_c, burnt_kg = warmed(case.car.engine, trajectory.fuel_kg, work_j, step_s, start_c)
    warm_kg, cold_kg = trajectory.total_fuel_kg, float(np.sum(burnt_kg))
    hot = np.flatnonzero(coolant_c >= START_C[1] - _NEARLY_HOT_K)
    ends_s = np.append(0.0, np.cumsum(step_s))
    return ColdFigures(
        litres(case.car, case.cycle, warm_kg),
        litres(case.car, case.cycle, cold_kg),
        100 * (cold_kg / warm_kg - 1),
        float(coolant_c[-1]),
        float(ends_s[hot[0]]) if len(hot) else None,
    )
