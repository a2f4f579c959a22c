"""The engine follows the power that is asked for: a rule for cars whose engine has a speed of its own.

It is asked for the power at the wheels, and more the more charge is missing below a reference:

    asked = wheels + charge_power x (reference - stored) / half the window

The engine starts where that exceeds `engine_on_power_w` and stops where it falls below `engine_off_power_w`; it
also runs where nothing drives the car without fuel. Running, it takes the control of least cost that charges the
battery with the second term, or lets it assist with as much. In a series car that is the power follower of ADVISOR
(T. Markel and others, "ADVISOR: a systems analysis tool for advanced vehicle modeling", J. Power Sources 110, 2002)
with a threshold below which it rests, in a power split the rule that starts the engine above a power.

What the car's file leaves open in `[rules]` is calibrated on the cycle: of a grid over starting power, the share of
it that stops, and charging power, each with the reference that leaves the charge neutral, the member of least
charge-corrected cost.
"""

from itertools import product

import numpy as np

from hevopt.problem.arrays import Array
from hevopt.problem.battery import energy_j, soc
from hevopt.problem.problem import Plan, Problem
from hevopt.strategies import _hysteresis_kernels as kernels
from hevopt.strategies._hysteresis import HysteresisStepper, best_limits
from hevopt.strategies._rules import Rules, rules_of, shifted_entries

_POWERS = 12
_OFF_SHARES = 0.4, 0.7, 1.0
# Of the most that any control charges with.
_CHARGE_SHARES = 0.1, 0.3, 0.8


def start(problem: Problem) -> HysteresisStepper:
    """The family's member that suits the problem best; see the module."""
    rules = rules_of(problem)
    rule, low_high = _rule_of(rules), problem.window_j
    half_j = 0.5 * (low_high[1] - low_high[0])
    limits, inside = best_limits(rules, rule, _members(rules, half_j))
    thresholds = {
        "engine_on_power_w": float(limits[2]),
        "engine_off_power_w": float(limits[3]),
        "charge_power_w": float(limits[0] * half_j),
        "reference_soc": float(soc(problem.battery, limits[1])),
    }
    return HysteresisStepper(rules, rule, limits, {"thresholds": thresholds, "inside": inside})


def start_on(problem: Problem, points: Problem, interval_s: float) -> HysteresisStepper:
    """The member that suits the problem best, on operating points: any of them, however often."""
    return start(problem).on(points, _rule_of)


def solve(problem: Problem) -> Plan:
    """The plan of the family's best member; notes["thresholds"] are its, by their keys in a car's file."""
    return start(problem).plan()


def _rule_of(rules: Rules) -> kernels.HysteresisRule:
    steps = rules.steps
    engine = shifted_entries(rules)
    return kernels.HysteresisRule(
        steps.power_w, steps.electric, engine, rules.charge_w, steps.modes, rules.price_kgpj
    )


def _members(rules: Rules, half_j: float) -> Array:
    """(member, 4) limits; the reference NaN where it is settled on the cycle."""
    given, battery = rules.problem.thresholds, rules.problem.battery
    top_w = float(np.max(rules.steps.power_w[rules.electric], initial=0.0))
    most_w = float(np.max(rules.charge_w))
    on_w = np.linspace(0.0, top_w, _POWERS).tolist()
    charge_w = [share * most_w for share in _CHARGE_SHARES]
    reference_j = np.nan
    if given.reference_soc is not None:
        reference_j = float(energy_j(battery, given.reference_soc))
    if given.engine_on_power_w is not None:
        on_w = [given.engine_on_power_w]
    if given.charge_power_w is not None:
        charge_w = [given.charge_power_w]
    off_w = given.engine_off_power_w
    if off_w is None:
        on_off = [(on, min(share * on, on)) for on in on_w for share in _OFF_SHARES]
    else:
        on_off = [(max(on, off_w), off_w) for on in on_w]
    return np.array(
        [(charge / half_j, reference_j, on, off) for (on, off), charge in product(on_off, charge_w)]
    )
