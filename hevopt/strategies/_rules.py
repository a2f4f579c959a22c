"""What the rule-based strategies share: a driver's classes of step, and a charging power that keeps the charge.

    standing   engine off, where it may be; on while a gear is engaged for a launch that the engine will drive
    braking    without fuel where that is possible, recovering the most
    driving    electrically up to a power and a speed and above a state of charge; else by the engine, which
               charges with a given power or is assisted by it (load-point shift, up and down) at least cost,
               within a cap on NOx

The charging power is raised level by level until the charge is neutral; the last level and the one below it
then share the cycle, changing once on the way, so that the end charge comes out close.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from hevopt.bounds.prices import one_price_dual
from hevopt.display.facts import Shown
from hevopt.errors import DataError, InfeasibleError
from hevopt.problem.arrays import Array, Flags, Indices
from hevopt.problem.battery import energy_j
from hevopt.problem.choices import Choices, State, choices_of, require_choices
from hevopt.problem.problem import Plan, Problem
from hevopt.strategies import _family_kernels as family
from hevopt.strategies import _rule_kernels as kernels
from hevopt.strategies._entries import least_entries, step_minimum
from hevopt.strategies._neutral_kernels import neutral_drive

_CHARGE_LEVELS, _ASSIST_LEVELS = 41, 20
# Electric driving stops here where nothing says otherwise: this share of the SOC window above its lower end.
_SOC_LEVEL_SHARE = 0.25
# What the end charge of a member may be worth, of its cost.
_ELIGIBLE_SHARE = 0.01


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Rules(Shown):
    """What a problem leaves to its rules.

    steps: what all members see; span: start, end and window
    fired: (entry,) whether the engine burns fuel
    charge_w: (level,) charging powers of the engine, < 0 where the battery assists
    price_kgpj: what a joule of end charge is worth
    """

    problem: Problem
    choices: Choices
    steps: family.FamilySteps
    span: kernels.Span
    fired: Flags
    charge_w: Array
    price_kgpj: float

    @property
    def electric(self) -> Flags:
        """(time,) steps of driving that can be driven without fuel."""
        steps = self.steps
        possible: Flags = ~steps.standing & ~steps.braking & (steps.electric >= 0)
        return possible


class ElectricLimits(NamedTuple):
    """Up to where a member drives electrically: above a state of charge, up to a power and a speed."""

    soc: float
    power_w: float
    speed_mps: float


class Tried(NamedTuple):
    """A member of a rule family: its limits, what of it stands in a calibration, the engine's entries by charging
    power, (level, time), and its result: cost, NOx, surplus of charge, whether it is inside."""

    limits: ElectricLimits
    settings: Mapping[str, float]
    engine: Indices
    result: Array


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Calibrated(Shown):
    """A stepper of the member that a calibration chose, and its plan, which tells of all members.

    rules: those of the problem that it was calibrated on
    rule, engine: what it takes, and the engine's entries (time,)
    level: charging power, and before which step it is that one, from there on the one below
    """

    rules: Rules
    member: Tried
    rule: kernels.Rule
    engine: Indices
    level: tuple[int, int]
    plan: Plan

    def decide(self, k: int, energy_j: float, mode: int) -> int:
        """Index of the control that the rule takes at step k."""
        choices = self.rules.choices
        entry = kernels.entry_at(self.rule, self.engine, k, energy_j, mode, choices)
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
    price_kgpj = one_price_dual(problem)[-1].price_kgpj if like is None else like.price_kgpj
    standing = signals.speed_mps == 0
    steps = family.FamilySteps(
        off=least_entries(choices, choices.power_w, ~on),
        electric=least_entries(choices, choices.power_w, fuel == 0),
        recover=least_entries(choices, choices.power_w, fuel == step_minimum(choices, fuel)[step]),
        standing=standing,
        engaging=standing & (signals.gear > 0),
        braking=signals.wheel_power_w < 0,
        power_w=signals.wheel_power_w,
        speed_mps=signals.speed_mps,
        modes=table.mode[choices.control],
        nox_kg=table.nox_kg[step, choices.control],
        price_kgpj=price_kgpj,
    )
    start = State(problem.start_mode, problem.start_j)
    return Rules(
        problem=problem,
        choices=choices,
        steps=steps,
        span=kernels.Span(start, problem.end_min_j, *problem.battery.granted_window_j),
        # Standing or driving, the engine rule never picks a control without fuel.
        fired=on & (fuel > 0),
        charge_w=_charging_w(choices) if like is None else like.charge_w,
        price_kgpj=price_kgpj,
    )


def _charging_w(choices: Choices) -> Array:
    """(level,) powers from the most that assists to the most that charges, 0 among them."""
    charge_w, assist_w = (float(np.max(sign * choices.power_w, initial=0.0)) for sign in (-1, 1))
    assisting = np.linspace(-assist_w, 0.0, _ASSIST_LEVELS, endpoint=False)
    return np.concatenate([assisting, np.linspace(0.0, charge_w, _CHARGE_LEVELS)])


def usual_limits(rules: Rules) -> ElectricLimits:
    """Where the file says nothing: the usual state of charge, any power and speed."""
    battery, given = rules.problem.battery, rules.problem.thresholds.electric
    share_soc = battery.soc_min + _SOC_LEVEL_SHARE * (battery.soc_max - battery.soc_min)
    chosen = share_soc, np.inf, np.inf
    return ElectricLimits(
        *(usual if own is None else own for usual, own in zip(chosen, given, strict=True))
    )


def figures_of(
    rules: Rules, limits: Sequence[ElectricLimits], engine: Indices, *, quick: bool = False
) -> Array:
    """(member, 4) cost, NOx, surplus of charge and whether it is inside, of neutral members of a family.

    engine: (level, time) entries by charging power, of `engine_entries`
    quick: of drives that end with up to a level's charge more than neutral
    """
    kernel = family.screened if quick else family.judged
    battery = rules.problem.battery.arrays
    return kernel(rules.steps, _rows(rules, limits), engine, rules.choices, rules.span, battery)


def tried(
    rules: Rules, limits: Sequence[ElectricLimits], engine: Indices, **settings: float
) -> list[Tried]:
    """Neutral members of a family with one list of engine's entries; settings: what else the calibration tells."""
    return as_tried(limits, engine, figures_of(rules, limits, engine), **settings)


def as_tried(
    limits: Sequence[ElectricLimits], engine: Indices, results: Array, **settings: float
) -> list[Tried]:
    """Members of a family by their limits and (member, 4) results; see `tried`."""
    return [
        Tried(own, {**told(own), **settings}, engine, result)
        for own, result in zip(limits, results, strict=True)
    ]


def told(limits: ElectricLimits) -> dict[str, float]:
    """What a calibration tells of limits."""
    return {
        "threshold_w": float(limits.power_w),
        "threshold_mps": float(limits.speed_mps),
        "threshold_soc": float(limits.soc),
    }


def eligible(rules: Rules, results: Array) -> Flags:
    """(member,) whether the window is kept and the end charge is worth at most a share of the cost.

    Stricter than what rows call neutral, energy of that share: a joule of charge is worth more than one of fuel.
    """
    cost_kg, _, surplus_j, inside = results.T
    worth_kg = np.abs(surplus_j) * rules.price_kgpj
    kept: Flags = (inside > 0) & (worth_kg <= _ELIGIBLE_SHARE * cost_kg)
    return kept


def corrected_kg(rules: Rules, results: Array) -> Array:
    """(member,) cost less what the charge beyond the asked one is worth."""
    kg: Array = results[:, 0] - rules.price_kgpj * results[:, 2]
    return kg


def calibrated(
    rules: Rules, members: Sequence[Tried], figure: Callable[[Mapping[str, Any]], Any]
) -> Calibrated:
    """The eligible member of least figure; the whole family is its calibration, for the curve."""
    results = np.array([member.result for member in members])
    able, corrected = eligible(rules, results), corrected_kg(rules, results)
    calibration = [
        {
            **member.settings,
            "cost_kg": float(member.result[0]),
            "corrected_kg": float(corrected[n]),
            "nox_kg": float(member.result[1]),
            "surplus_j": float(member.result[2]),
            "inside": bool(member.result[3] > 0),
            "eligible": bool(able[n]),
        }
        for n, member in enumerate(members)
    ]
    inside = [n for n, member in enumerate(calibration) if member["inside"]]
    if not inside:
        raise InfeasibleError(
            "no member of the rule family keeps the SOC window; widen it or use dp or ecms"
        )
    fit = [n for n in inside if able[n]] or inside
    chosen = min(fit, key=lambda n: figure(calibration[n]))
    member, battery = members[chosen], rules.problem.battery.arrays
    rule, middle = rule_for(rules, member.limits), len(member.engine) // 2
    driven, engine, level = neutral_drive(
        rule, member.engine, middle, rules.choices, rules.span, battery
    )
    notes = {"calibration": calibration, "chosen": chosen}
    plan = Plan(rules.choices.control[driven.entry], notes)
    return Calibrated(rules, member, rule, engine, level, plan)


def rule_for(rules: Rules, limits: ElectricLimits) -> kernels.Rule:
    """The rule of a member with some limits."""
    rule: kernels.Rule = family.rule_of(rules.steps, _rows(rules, [limits])[0])
    return rule


def _rows(rules: Rules, limits: Sequence[ElectricLimits]) -> Array:
    """(member, 3) ElectricLimits with the stored energy in place of the state of charge."""
    battery, rows = rules.problem.battery, np.array(limits, dtype=np.float64)
    rows[:, 0] = energy_j(battery, np.clip(rows[:, 0], battery.soc_min, battery.soc_max))
    return rows


def engine_entries(rules: Rules, nox_cap_kgps: float = np.inf) -> Indices:
    """(level, time) entries that the engine drives with under a cap on NOx, by charging power."""
    shifted = shifted_entries(rules, nox_cap_kgps)
    # Load-point shift is for driving; standing, the engine covers the electric load and no more.
    return np.where(rules.steps.standing, shifted[_ASSIST_LEVELS], shifted)


def shifted_entries(rules: Rules, nox_cap_kgps: float = np.inf) -> Indices:
    """(level, time) entries of least cost with the engine on, by charging power, standing or driving."""
    steps = rules.steps
    shifted = kernels.load_point_choices(
        rules.choices, steps.nox_kg, rules.fired, rules.charge_w, float(nox_cap_kgps)
    )
    return np.where(shifted >= 0, shifted, steps.recover)


def idle_entries(rules: Rules) -> Indices:
    """(time,) those of them that leave the battery alone."""
    entries: Indices = shifted_entries(rules)[_ASSIST_LEVELS]
    return entries
