"""The engine charges at its best point from one state of charge to another, then rests: a rule for series cars.

Below `thermostat_on_soc` it starts and takes, at every step, the control of least cost per energy that is stored
more than in driving without fuel, or drawn less, the battery's losses at the start's charge taken off; at
`thermostat_off_soc` it stops. Where nothing drives the car without fuel, the engine gives what is asked for and
leaves the battery alone. M. Ehsani, Y. Gao and A. Emadi, Modern Electric, Hybrid Electric, and Fuel Cell Vehicles,
CRC Press 2010, call it engine on-off or thermostat control, in the chapter on series hybrids.

What the car's file leaves open in `[rules]` is calibrated on the cycle: of all pairs on a grid over the window, the
member of least charge-corrected cost among those whose end charge is near the asked one.
"""

import numpy as np

from hevopt.bounds.bounded import drain_at_j
from hevopt.errors import DataError
from hevopt.problem.arrays import Array, Indices
from hevopt.problem.battery import energy_j, soc
from hevopt.problem.problem import Plan, Problem
from hevopt.strategies import _hysteresis_kernels as kernels
from hevopt.strategies._entries import least_entries
from hevopt.strategies._hysteresis import HysteresisStepper, best_limits
from hevopt.strategies._rules import Rules, idle_entries, rules_of

# Of the window's width above its lower end: 39 values.
_SOC_SHARES = np.arange(1, 40) / 40


def start(problem: Problem) -> HysteresisStepper:
    """The family's member that suits the problem best; see the module."""
    rules = rules_of(problem)
    rule = _rule_of(rules)
    limits, inside = best_limits(rules, rule, _members(problem))
    socs = soc(problem.battery, -limits[2:])
    thresholds = dict(zip(("thermostat_on_soc", "thermostat_off_soc"), socs.tolist(), strict=True))
    return HysteresisStepper(rules, rule, limits, {"thresholds": thresholds, "inside": inside})


def start_on(problem: Problem, points: Problem, interval_s: float) -> HysteresisStepper:
    """The member that suits the problem best, on operating points: any of them, however often."""
    return start(problem).on(points, _rule_of)


def solve(problem: Problem) -> Plan:
    """The plan of the family's best member; notes["thresholds"] are its, by their keys in a car's file."""
    return start(problem).plan()


def _rule_of(rules: Rules) -> kernels.HysteresisRule:
    """A rule that is asked for no power but what is stored, negative: below a charge, above a power."""
    steps = rules.steps
    nothing = np.zeros(len(steps.power_w))
    best = _best_entries(rules)[None, :]
    return kernels.HysteresisRule(
        nothing, steps.electric, best, np.zeros(1), steps.modes, rules.price_kgpj
    )


def _best_entries(rules: Rules) -> Indices:
    """(time,) entries of least cost per energy stored; where there are none, those that leave the battery alone."""
    choices, electric = rules.choices, rules.steps.electric
    drain_j = drain_at_j(rules.problem, choices, rules.problem.start_j)
    used_j = np.where(electric >= 0, drain_j[electric], -np.inf)
    made_j = choices.spread(used_j) - drain_j
    makes = rules.fired & (made_j > 0)  # nor NaN, more than the battery delivers
    best = least_entries(choices, choices.cost_kg / np.where(makes, made_j, 1.0), makes)
    return np.where(best >= 0, best, idle_entries(rules))


def _members(problem: Problem) -> Array:
    """(member, 4) limits of all pairs of states of charge, the first below the second."""
    battery, given = problem.battery, problem.thresholds
    usual = battery.soc_min + _SOC_SHARES * (battery.soc_max - battery.soc_min)
    on, off = (
        usual if own is None else np.array([own])
        for own in (given.thermostat_on_soc, given.thermostat_off_soc)
    )
    pairs = np.array([(one, other) for one in on for other in off if one < other])
    if not len(pairs):
        key = "thermostat_off_soc" if given.thermostat_on_soc is None else "thermostat_on_soc"
        raise DataError(
            f"rules: {key} {getattr(given, key):g} lies at the end of the SOC window, which leaves no room for the "
            "other threshold; leave it out to have it calibrated"
        )
    limits = np.tile([1.0, 0.0, 0.0, 0.0], (len(pairs), 1))
    limits[:, 2:] = -energy_j(battery, pairs)
    return limits
