"""All strategies by name: Problem to Plan. A new strategy is one file and one line here."""

from collections.abc import Callable
from typing import NamedTuple

from hevopt.errors import unknown_name
from hevopt.problem import Plan, Problem
from hevopt.strategies import baseline, conventional, dp, ecms, nox_cut, start_stop


class Strategy(NamedTuple):
    """How to solve, and the functions (Table 1) an architecture needs for the strategy to make sense."""

    solve: Callable[[Problem], Plan]
    needs: frozenset[str]
    excludes: frozenset[str]


_HYBRID = frozenset({"power_management"})
_STOP = frozenset({"start_stop"})
_NONE: frozenset[str] = frozenset()

STRATEGIES: dict[str, Strategy] = {
    "baseline": Strategy(baseline.solve, _NONE, _STOP | _HYBRID),
    "start_stop": Strategy(start_stop.solve, _STOP, _HYBRID),
    "conventional": Strategy(conventional.solve, _HYBRID, _NONE),
    "nox_cut": Strategy(nox_cut.solve, _HYBRID | {"nox_cut"}, _NONE),
    "ecms": Strategy(ecms.solve, _STOP, _NONE),
    "dp": Strategy(dp.solve, _STOP, _NONE),
}


def strategy_named(name: str) -> Strategy:
    """The strategy of a name; DataError with the close matches otherwise."""
    if name not in STRATEGIES:
        raise unknown_name("strategy", name, list(STRATEGIES))
    return STRATEGIES[name]


def fitting(functions: frozenset[str]) -> list[str]:
    """Names of the strategies that make sense for an architecture's functions, in order."""
    return [
        name
        for name, strategy in STRATEGIES.items()
        if strategy.needs <= functions and not strategy.excludes & functions
    ]
