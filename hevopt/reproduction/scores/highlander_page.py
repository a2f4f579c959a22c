"""What is found on the car of a learning benchmark, as a section of the page: every figure in it is computed."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

from hevopt.problem.problem import Plan, Problem
from hevopt.problem.simulation import simulate
from hevopt.reproduction.scores import highlander as car
from hevopt.reproduction.scores import highlander_data as data
from hevopt.reproduction.scores.bounds import bound
from hevopt.reproduction.scores.highlander_agent import AgentGoal, driven
from hevopt.reproduction.verdicts import markdown
from hevopt.strategies import a_ecms, dp, ecms, mpc, power_follower

# Of the 2000 actions: those that plans and agents choose among, and those that the bound speaks of.
PLANNED = 101
BOUNDED = data.ACTIONS
_KG_PER_KWH = data.KG_PER_GALLON / data.KWH_PER_GALLON
SOLVERS: dict[str, Callable[[Problem], Plan]] = {
    "dp": dp.solve,
    "ecms": ecms.solve,
    "mpc": mpc.solve,
    "power_follower": power_follower.solve,
    "a_ecms": a_ecms.solve,
}
_BEST, _KEEPS, _FREE = "its reward, its lock", "fuel alone, its lock", "its reward, no lock"
GOALS = {
    _BEST: AgentGoal(True, False),
    _KEEPS: AgentGoal(True, True),
    _FREE: AgentGoal(False, False),
}


class DecidedRow(NamedTuple):
    """Who decided, what was burnt, the charge left, and the least that any plan burns that leaves as much."""

    name: str
    fuel_kg: float
    soc_end: float
    bound_kg: float

    @property
    def below(self) -> float:
        """Share of its fuel by which any plan of its end charge can lie below it, at most."""
        return 1 - self.bound_kg / self.fuel_kg


class Learnt(NamedTuple):
    """Rows of strategies and agents. bound_kg: that of the charge at the start; coarse: what the bound may miss"""

    strategies: Sequence[DecidedRow]
    agents: Sequence[DecidedRow]
    bound_kg: float
    coarse: float | None

    def saved(self) -> float:
        """Energy of the fuel that one of charge saves, by the bounds of both ends of the agents' range."""
        low, high = (pick(self.agents, key=lambda row: row.soc_end) for pick in (min, max))
        charge_kwh = (high.soc_end - low.soc_end) * data.BATTERY_KWH
        return (high.bound_kg - low.bound_kg) / (charge_kwh * _KG_PER_KWH)


def scored(told: Callable[[str], None], planned: int = PLANNED, bounded: int = BOUNDED) -> Learnt:
    """Every strategy and every agent on the cycle. told: hears whose turn it is"""
    whole = car.problem(bounded, "outer")
    problem = car.problem(planned)
    strategies = []
    for name, solve in SOLVERS.items():
        told(name)
        path = simulate(problem, solve(problem).control)
        strategies.append(_row(name, path.total_fuel_kg, float(path.soc[-1]), whole))
    agents = []
    for name, goal in GOALS.items():
        told(name)
        drive = driven(goal, planned)
        burnt_kg = drive.fuel_kwh * _KG_PER_KWH
        agents.append(_row(name, burnt_kg, float(drive.soc[-1]), whole))
    bound_kg, _, coarse = bound(whole)
    return Learnt(strategies, agents, bound_kg, coarse)


def _row(name: str, fuel_kg: float, soc_end: float, whole: Problem) -> DecidedRow:
    return DecidedRow(name, fuel_kg, soc_end, bound(replace(whole, soc_end_min=soc_end))[0])


def section(told: Learnt) -> str:
    """The section, Markdown."""
    heads = (
        "who decides", "fuel, g", "charge at the end", "at equal charge, g", "the bound lies below it, %",
    )  # fmt: skip
    lines = [_line(row, told.bound_kg) for row in [*told.strategies, *told.agents]]
    strategies = {row.name: row for row in told.strategies}
    agents = {row.name: row for row in told.agents}
    rule, plain, best = strategies["power_follower"], strategies["ecms"], agents[_BEST]
    free, kept = agents[_FREE], agents[_KEEPS]
    coarse = 0.0 if told.coarse is None else 100 * told.coarse
    return f"""## The car of a learning benchmark

DRL-Base-EMS (github.com/LittleWebCat/DRL-Base-EMS, of "A comparative study of 13 deep reinforcement learning based
energy management methods for a hybrid electric vehicle", H. Wang, B. Xu and others, 2022): a car like the 2016
Highlander Hybrid in a step after FASTSim, UDDS, charge {data.SOC_START:g} at the start. Its equations and figures
in code of our own; a table of {PLANNED} of its {data.ACTIONS} actions, whose plans drive in its own
step to rounding.

{markdown(heads, "lrrrr", lines)}

**No plan of its {BOUNDED} actions burns less than {told.bound_kg * 1e3:.2f} g** and ends with the charge of the
start; the bound of every second action lies {coarse:.3f} % higher, so that powers between two of them, to which its
step cuts what the engine's ramp forbids, change little. It speaks of plans that keep the charge between
{car.SOC_BAND[0]:g} and {car.SOC_BAND[1]:g}, where its step is one table. Each row is held against the bound of its
own end charge; *at equal charge* is its fuel with the difference of both bounds. Plans rise in engine power a
little slower than the ramp allows, the bound lets them rise a little faster.

The abstract quotes an agent {data.BELOW_RULES_PERCENT:g} % below rules and {data.BELOW_ECMS_PERCENT:g} % below
ECMS. As far as car, cycle and step are those of its study, no controller of equal end charge lies more than
{100 * plain.below:.2f} % below this ecms, nor more than {100 * rule.below:.2f} % below this rule, both calibrated
on the cycle: what is quoted beyond that tells of the rules and the ECMS it was held against, or of charge at
the end.

**What its reward and its lock cost an agent.** The reward counts a kWh of charge like one of fuel, but it saves
{told.saved():.1f} of fuel: followed to the letter without the lock it empties the battery, here to the end of the
band, and leaves {100 * free.below:.2f} % to gain at an end charge of {free.soc_end:.3f}. So a lock takes the action
away at and below {data.LOCK_SOC:g}, where the drive also begins. With it an agent of that reward ends at
{best.soc_end:.3f} and leaves {100 * best.below:.2f} %; one of the same lock that wants the least fuel and at least
the charge of the start leaves {100 * kept.below:.2f} %: most of what either leaves is the lock's. These agents know
the whole cycle, by a recursion over charge: near the best of their kind, not proven to be it."""


def _line(row: DecidedRow, bound_kg: float) -> tuple[str, ...]:
    equal_kg = row.fuel_kg + bound_kg - row.bound_kg
    name = row.name if row.name in SOLVERS else f"agent: {row.name}"
    return (
        name,
        f"{row.fuel_kg * 1e3:.2f}",
        f"{row.soc_end:.4f}",
        f"{equal_kg * 1e3:.2f}",
        f"{100 * row.below:.2f}",
    )
