"""Forward runs that several tests look at, made once."""

from functools import cache

import numpy as np

from hevopt import drive, load_architecture, load_cycle
from hevopt.car.handling import Handling, Shifting, Tyre
from hevopt.driving.cycle import Cycle
from hevopt.forward.lines import line_of
from hevopt.forward.plans import replay_of
from hevopt.forward.run import follow
from hevopt.problem.simulation import simulate
from hevopt.strategies import STRATEGIES

STRATEGY = {"A": "baseline", "B": "start_stop"}
# Neither tyre's lag nor a gap in the torque.
STIFF = Handling(Tyre(lag_s=0.0), shifting=Shifting(gap_s=0.0))


@cache
def driven(name, cycle="nedc", step_s=0.01):
    """A car's plan driven: dp's, or the usual one of a car without power management."""
    return drive(
        load_architecture(name), load_cycle(cycle), STRATEGY.get(name, "dp"), step_s=step_s
    )


@cache
def plan_of(name, cycle="nedc", **changes):
    """(car, cycle, plan) to be driven in another way than usual."""
    from hevopt import build_problem

    car = load_architecture(name, dict(changes.get("changes", ())))
    trace = load_cycle(cycle)
    problem = build_problem(car, trace, allow_shortfall=True)
    trajectory = simulate(problem, STRATEGIES[STRATEGY.get(name, "dp")].solve(problem).control)
    return car, trace, replay_of(trajectory, line_of(car)), trajectory


def constant(speed_kmh, seconds=120):
    """A cycle at one speed, moving from the first second on."""
    time_s = np.arange(seconds + 1.0)
    return Cycle("constant", time_s, np.full(seconds + 1, speed_kmh / 3.6), np.zeros(seconds + 1))


def ramp(top_mps, rise_s, seconds, grade=0.0):
    """At rest for five seconds, then faster up to a speed."""
    time_s = np.arange(seconds + 1.0)
    speed = np.clip((time_s - 5) / rise_s, 0, 1) * top_mps
    return Cycle("ramp", time_s, speed, np.full(seconds + 1, grade))


__all__ = ["STIFF", "STRATEGY", "constant", "driven", "follow", "plan_of", "ramp"]
