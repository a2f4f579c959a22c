"""What the rule-based strategies share: a driver's classes of step, and a charging power that keeps the charge.

    standing   engine off, where it may be; on while a gear is engaged for a launch that the engine will drive
    braking    without fuel where that is possible, recovering the most
    driving    electrically below a power threshold and above a state of charge; else by the engine, which
               charges with a given power (load-point shift) at least cost, within a cap on NOx

The charging power is raised level by level until the charge is neutral; the last level and the one below it
then share the cycle, changing once on the way, so that the end charge comes out close.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from hevopt.bounds.prices import one_price_dual
from hevopt.display.facts import Shown
from hevopt.errors import DataError, InfeasibleError
from hevopt.problem.arrays import Array, Flags, Indices
from hevopt.problem.choices import Choices, State, choices_of, require_choices
from hevopt.problem.problem import Plan, Problem
from hevopt.problem.simulation import total_cost_kg
from hevopt.problem.switching import switched
from hevopt.strategies import _rule_kernels as kernels

_CHARGE_LEVELS = 41
# Electric driving stops here: this share of the SOC window above its lower end.
_SOC_LEVEL_SHARE = 0.25


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Rules(Shown):
    """Indices that each rule would take, per step; -1 where a step has none.

    off, electric, recover: (time,); standing, engaging, braking, power_w: (time,) class and wheel power, engaging
    being standing with a gear engaged; fired: (entry,) whether the engine burns fuel
    charge_w: (level,) charging powers of the engine; price_kgpj: what a joule of end charge is worth
    """

    problem: Problem
    choices: Choices
    off: Indices
    electric: Indices
    recover: Indices
    standing: Flags
    engaging: Flags
    braking: Flags
    power_w: Array
    fired: Flags
    charge_w: Array
    price_kgpj: float


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Outcome(Shown):
    """One member of a rule family: its controls, cost, NOx and end charge.

    rule, engine: what it takes, and the engine's entries (time,); control: (time,) controls that were taken
    threshold_w, level: highest power driven electrically; charging power, and before which step it is that one
    """

    threshold_w: float
    rule: kernels.Rule
    engine: Indices
    level: tuple[int, int]
    control: Indices
    cost_kg: float
    nox_kg: float
    surplus_j: float
    inside: bool


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Calibrated(Shown):
    """A stepper of the member that a calibration chose, and its plan, which tells of all members.

    rules: those of the problem that it was calibrated on; settings: of the member
    """

    rules: Rules
    settings: Mapping[str, Any]
    outcome: Outcome
    plan: Plan

    def decide(self, k: int, energy_j: float, mode: int) -> int:
        """Index of the control that the rule takes at step k."""
        rule, engine = self.outcome.rule, self.outcome.engine
        choices = self.rules.choices
        entry = kernels.entry_at(rule, engine, k, energy_j, mode, choices)
        return int(choices.control[entry])


def rules_of(problem: Problem, like: Rules | None = None) -> Rules:
    """The rules' entries on a problem; DataError where it has no signals to base rules on.

    like: rules whose charging powers, and worth of charge, these take over
    """
    table = problem.table
    if table.signals is None:
        raise DataError("rule-based strategies need a table with signals (speed, power, gear)")
    choices = choices_of(problem)
    require_choices(problem, choices, "the rules")
    engine_on = np.array([control.engine_on for control in table.controls])
    step = choices.spread(np.arange(choices.steps))
    fuel = table.fuel_kg[step, choices.control]
    on = engine_on[choices.control]
    signals = table.signals
    standing, braking = signals.speed_mps == 0, signals.wheel_power_w < 0
    charge_max = float(np.max(-choices.power_w, initial=0.0))
    return Rules(
        problem=problem,
        choices=choices,
        off=_least(choices, choices.power_w, ~on),
        electric=_least(choices, choices.power_w, fuel == 0),
        recover=_least(choices, choices.power_w, fuel == _step_minimum(choices, fuel)[step]),
        standing=standing,
        engaging=standing & (signals.gear > 0),
        braking=braking,
        power_w=signals.wheel_power_w,
        # Standing or driving, the engine rule never picks a control without fuel.
        fired=on & (fuel > 0),
        charge_w=np.linspace(0.0, charge_max, _CHARGE_LEVELS) if like is None else like.charge_w,
        price_kgpj=(one_price_dual(problem)[-1].price_kgpj if like is None else like.price_kgpj),
    )


def neutral_outcome(rules: Rules, threshold_w: float, engine: Indices) -> Outcome:
    """The family's member for an electric threshold, its charging power found for neutrality.

    engine: (level, time) entries by charging power, of `engine_entries`
    """
    choices, problem, rule = rules.choices, rules.problem, rule_of(rules, threshold_w)
    driven, burning, level = kernels.neutral_drive(
        rule, engine, choices, State(problem.start_mode, problem.start_j), problem.end_min_j,
        problem.battery.arrays,
    )  # fmt: skip
    return _outcome(rules, threshold_w, rule, driven, burning, level)


def rule_of(rules: Rules, threshold_w: float) -> kernels.Rule:
    """The family's rule for an electric threshold."""
    driving = ~rules.standing & ~rules.braking
    electric = driving & (rules.power_w <= threshold_w) & (rules.electric >= 0)
    launch_on_engine = rules.engaging & ~_next_true(electric, rules.standing)
    stopped = rules.standing & ~launch_on_engine & (rules.off >= 0)
    low, high = rules.problem.window_j
    return kernels.Rule(
        electric=np.where(electric, rules.electric, -1),
        fixed=np.where(stopped, rules.off, np.where(rules.braking, rules.recover, -1)),
        modes=rules.problem.table.mode[rules.choices.control],
        least_j=low + _SOC_LEVEL_SHARE * (high - low),
        price_kgpj=rules.price_kgpj,
    )


def is_eligible(rules: Rules, outcome: Outcome, share: float = 0.01) -> bool:
    """Whether the window is kept and the end charge is worth at most a share of the cost.

    Stricter than what rows call neutral, energy of that share: a joule of charge is worth more than one of fuel.
    """
    worth_kg = abs(outcome.surplus_j) * rules.price_kgpj
    return outcome.inside and worth_kg <= share * outcome.cost_kg


def calibrated(
    rules: Rules,
    members: list[tuple[dict[str, Any], Outcome]],
    figure: Callable[[Mapping[str, Any]], float],
) -> Calibrated:
    """The eligible member of least figure; the whole family is its calibration, for the curve."""
    calibration = [
        {
            **settings,
            "cost_kg": outcome.cost_kg,
            "corrected_kg": outcome.cost_kg - rules.price_kgpj * outcome.surplus_j,
            "nox_kg": outcome.nox_kg,
            "surplus_j": outcome.surplus_j,
            "inside": outcome.inside,
            "eligible": is_eligible(rules, outcome),
        }
        for settings, outcome in members
    ]
    inside = [n for n, (_, outcome) in enumerate(members) if outcome.inside]
    if not inside:
        raise InfeasibleError(
            "no member of the rule family keeps the SOC window; widen it or use dp or ecms"
        )
    eligible = [n for n in inside if calibration[n]["eligible"]] or inside
    chosen = min(eligible, key=lambda n: figure(calibration[n]))
    told, outcome = members[chosen]
    notes = {"calibration": calibration, "chosen": chosen}
    return Calibrated(rules, told, outcome, Plan(outcome.control, notes))


def engine_entries(rules: Rules, nox_cap_kgps: float = np.inf) -> Indices:
    """(level, time) entries that the engine drives with under a cap on NOx, by charging power."""
    choices = rules.choices
    steps = choices.spread(np.arange(choices.steps))
    nox = rules.problem.table.nox_kg[steps, choices.control]
    shifted = kernels.load_point_choices(
        choices, nox, rules.fired, rules.charge_w, float(nox_cap_kgps)
    )
    shifted = np.where(shifted >= 0, shifted, rules.recover)
    # Load-point shift is for driving; standing, the engine covers the electric load and no more.
    return np.where(rules.standing, shifted[0], shifted)


def _outcome(
    rules: Rules,
    threshold_w: float,
    rule: kernels.Rule,
    driven: kernels.RuleDrive,
    engine: Indices,
    level: tuple[int, int],
) -> Outcome:
    """What a drive under a rule with the engine's entries, (time,), comes to."""
    problem, choices = rules.problem, rules.choices
    control, energy_j = choices.control[driven.entry], driven.energy_j
    steps = np.arange(choices.steps)
    switch = switched(problem.table, problem.start_mode, control)
    stored = np.concatenate([energy_j, energy_j[:-1] - switch.energy_j])
    least_j, greatest_j = problem.battery.granted_window_j
    return Outcome(
        threshold_w,
        rule,
        engine,
        level,
        control,
        total_cost_kg(problem, control)[0],
        float(np.sum(problem.table.nox_kg[steps, control])),
        float(energy_j[-1]) - problem.end_min_j,
        bool((stored >= least_j).all() and (stored <= greatest_j).all())
        and bool(switch.allowed.all()),
    )


def _next_true(flags: Flags, standing: Flags) -> Flags:
    """(time,) the flag of the first moving step at or after each step."""
    moving = np.flatnonzero(~standing)
    following = np.searchsorted(moving, np.arange(len(flags)))
    inside = following < len(moving)
    result = np.zeros(len(flags), dtype=bool)
    result[inside] = flags[moving[following[inside]]]
    return result


def _least(choices: Choices, figure: Array, allowed: Flags) -> Indices:
    """(time,) entry of least figure among the allowed ones, -1 where there is none."""
    masked = np.where(allowed, figure, np.inf)
    least = _step_minimum(choices, masked)
    step = choices.spread(np.arange(choices.steps))
    hits = np.flatnonzero((masked == least[step]) & np.isfinite(masked))
    entry = np.full(choices.steps, -1, dtype=np.int64)
    entry[step[hits][::-1]] = hits[::-1]
    return entry


def _step_minimum(choices: Choices, figure: Array) -> Array:
    return np.minimum.reduceat(figure, choices.first[:, 0])
