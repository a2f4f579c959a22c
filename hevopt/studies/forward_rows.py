"""What the rows of a comparison do when they are driven forward: figures beside the backward ones."""

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from hevopt.display.facts import Shown
from hevopt.errors import DataError, InfeasibleError
from hevopt.problem.problem import Trajectory
from hevopt.studies.rows import Row
from hevopt.units import KMH_PER_MPS

if TYPE_CHECKING:
    from hevopt.studies.case import Case
    from hevopt.studies.driven import DrivenPlan


@dataclass(frozen=True, slots=True, repr=False)
class ForwardFigures(Shown):
    """A row driven forward, see `DrivenPlan`; None where it could not be.

    status: its marks, "ok", or why it has no figures; decided: whether the strategy decided on the way
    change_percent: charge-corrected fuel against the row's own; where neither burns any, the energy from the
        battery, and None where the row took none
    """

    status: str
    decided: bool | None = None
    fuel_l_per_100km: float | None = None
    corrected_l_per_100km: float | None = None
    change_percent: float | None = None
    nox_mg_per_km: float | None = None
    soc_end: float | None = None
    engine_starts: int | None = None
    bound_l_per_100km: float | None = None
    rmsse_kmh: float | None = None
    violations: int | None = None
    electricity_kwh_per_100km: float | None = None

    def _facts(self) -> dict[str, object]:
        return {
            "corrected_l_per_100km": self.corrected_l_per_100km,
            "change_percent": self.change_percent,
            "status": self.status,
        }

    def as_dict(self) -> dict[str, Any]:
        """All fields by name, with forward_ in front."""
        return {f"forward_{name}": value for name, value in asdict(self).items()}


def forward_figures(
    case: "Case", row: Row, trajectory: Trajectory, horizon_s: float | None
) -> ForwardFigures:
    """A solved row of a case driven forward; what cannot be driven says so in its status."""
    # The forward plant: what drives nothing forward need not read it.
    from hevopt.studies.driven import Manner, drive_solved

    try:
        driven = drive_solved(case, row.strategy, horizon_s, (row, trajectory), Manner())
    except (DataError, InfeasibleError) as error:
        return ForwardFigures(f"not driven: {error.headline}")
    return figures_of(driven)


def figures_of(driven: "DrivenPlan") -> ForwardFigures:
    """The figures of a forward run."""
    run = driven.run
    return ForwardFigures(
        ", ".join(driven.marks) or "ok",
        driven.asked is not None,
        driven.fuel_l_per_100km,
        driven.corrected_l_per_100km,
        driven.change_percent,
        driven.nox_mg_per_km,
        float(run.soc[-1]),
        run.starts,
        driven.bound_l_per_100km,
        run.quality.speed_error_mps * KMH_PER_MPS,
        len(run.quality.violations),
        driven.electricity_kwh_per_100km,
    )
