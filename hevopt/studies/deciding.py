"""Strategies that decide while the car is driven forward: which can, and from which rows."""

import numpy as np

from hevopt.errors import DataError
from hevopt.forward.asked import Asking, Decider
from hevopt.powertrain.points import points_of
from hevopt.problem.holding import with_holding
from hevopt.strategies import every_strategy, strategy_named
from hevopt.studies.case import Case
from hevopt.studies.solved import told


def decides(strategy: str) -> bool:
    """Whether a strategy can decide on the way: from operating points, or along its preview of the cycle.

    One that is only brought along with a call cannot: its plan is replayed.
    """
    known = every_strategy().get(strategy)
    if known is None:
        return False
    return known.start_on is not None or (known.previews and known.start is not None)


def decider_of(case: Case, strategy: str, horizon_s: float | None, asking: Asking) -> Decider:
    """A strategy of `decides`, ready to be asked on a case; along a preview once per step of the cycle."""
    asking.check()
    known, problem, engine = strategy_named(strategy), case.problem, case.car.engine
    settings, step_s = told(case, known, horizon_s), problem.table.step_s
    if known.start_on is None:
        if np.ptp(step_s) > 1e-6 * step_s[0]:
            raise DataError(
                f"strategy {strategy} is asked once per step of the cycle, which must be of one length; cycle "
                f"{case.cycle.name} has steps of {step_s.min():g} to {step_s.max():g} s; resample it"
            )
        assert known.start is not None  # as of `decides`
        asking = asking._replace(interval_s=float(step_s[0]))
        return Decider(strategy, known.start(problem, **settings), problem, None, asking)
    points = points_of(case.car, problem)
    if engine.least_on_s or engine.least_off_s:
        # Its own dwell is counted in rows.
        asking = asking._replace(interval_s=float(np.median(step_s)))
    stepper = known.start_on(problem, with_holding(points.problem), asking.interval_s, **settings)
    return Decider(strategy, stepper, points.problem, points, asking)
