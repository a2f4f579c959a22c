"""A plan to drive by: of the cycle as it is, or of as much of it as the car can do, and what that leaves out."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.driving.cycle import Cycle
from hevopt.errors import EndChargeError, InfeasibleError
from hevopt.powertrain.top_speed import top_speed_mps
from hevopt.studies.case import Case, prepare
from hevopt.studies.settings import Settings
from hevopt.units import KMH_PER_MPS

# Of the window of the state of charge, what a plan keeps below the highest end charge there is.
_BELOW_SOC = 0.02
# Highest speeds that are tried, as shares of the car's own: a little below it, and where power or charge do not
# last at that, ever slower.
_SHARES = (0.99, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3)


class PlannedCase(NamedTuple):
    """A solved case to drive by; marks: in what its cycle or end charge is less than was asked."""

    case: Case
    marks: tuple[str, ...] = ()


def planned_for(car: Architecture, cycle: Cycle, settings: Settings) -> PlannedCase:
    """The case of a car on a cycle, solved.

    Where the car has no plan for the cycle, or none but one that lacks torque beyond the speed at which engine or
    machines turn, it is that of the cycle at no more than a share of the car's highest speed, unless the cycle
    lists gears for its own; where no plan reaches the end charge, that of one a little below the highest that one
    does. InfeasibleError where that does not help either.
    """
    speed, shares = cycle.speed_mps, _SHARES if cycle.gear is None else ()
    # A step is driven at the mean of its ends.
    fastest = float(np.max((speed[1:] + speed[:-1]) / 2))
    top = top_speed_mps(car, fastest) if shares else fastest
    failed: InfeasibleError | None = None
    try:
        found = _lasting(car, cycle, settings)
    except InfeasibleError as error:
        failed = error
    else:
        missing_nm = found.case.problem.table.missing_torque_nm
        if top in (0.0, fastest) or missing_nm is None or not missing_nm.any():
            return found
    for share in shares if top > 0.0 else ():
        most = share * top
        slower = replace(cycle, speed_mps=np.minimum(cycle.speed_mps, most))
        mark = f"no plan follows the cycle: driven at no more than {most * KMH_PER_MPS:.0f} km/h"
        try:
            found = _lasting(car, slower, settings)
        except InfeasibleError as error:
            failed = failed or error
            continue
        return PlannedCase(found.case, (mark, *found.marks))
    raise InfeasibleError(
        f"{car.name} cannot be driven along {cycle.name}, as there is no plan to drive by: {failed}"
    )


def _lasting(car: Architecture, cycle: Cycle, settings: Settings) -> PlannedCase:
    """The case at the end charge that is asked, or else at the highest one."""
    try:
        return PlannedCase(prepare(car, cycle, settings))
    except EndChargeError as error:
        window = car.battery.soc_max - car.battery.soc_min
        lower = max(error.reachable_soc - _BELOW_SOC * window, car.battery.soc_min)
    mark = f"no plan ends at SOC {car.soc_end:.4f}: driven by one that ends at {lower:.4f}"
    return PlannedCase(prepare(replace(car, soc_end=lower), cycle, settings), (mark,))
