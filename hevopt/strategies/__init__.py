"""All strategies by name: Problem to Plan. A new strategy is one file and one line here."""

from collections.abc import Callable
from typing import NamedTuple

from hevopt.errors import unknown_name
from hevopt.problem.problem import Plan
from hevopt.strategies import (
    a_ecms,
    baseline,
    conventional,
    convex,
    dp,
    ecms,
    mpc,
    nox_cut,
    sdp,
    start_stop,
)


class Strategy(NamedTuple):
    """How to solve, what is known while driving, and the functions (Table 1) an architecture needs for it.

    causal: decides each step without knowing more of the cycle than `knows` says
    usual: part of a comparison that names no strategies
    previews: takes horizon_s; learns: takes training, problems of the same car on other cycles
    """

    solve: Callable[..., Plan]
    knows: str
    needs: frozenset[str]
    excludes: frozenset[str] = frozenset()
    causal: bool = False
    usual: bool = True
    previews: bool = False
    learns: bool = False


_HYBRID = frozenset({"power_management"})
_STOP = frozenset({"start_stop"})
_NONE: frozenset[str] = frozenset()
_RULE = "present step; its parameters are calibrated on the cycle"

STRATEGIES: dict[str, Strategy] = {
    "baseline": Strategy(baseline.solve, "present step", _NONE, _STOP | _HYBRID, causal=True),
    "start_stop": Strategy(start_stop.solve, _RULE, _STOP, _HYBRID),
    "conventional": Strategy(conventional.solve, _RULE, _HYBRID),
    "nox_cut": Strategy(nox_cut.solve, _RULE, _HYBRID | {"nox_cut"}),
    "ecms": Strategy(ecms.solve, "whole cycle", _STOP),
    "dp": Strategy(dp.solve, "whole cycle", _STOP),
    "convex": Strategy(convex.solve, "whole cycle", _HYBRID, usual=False),
    "mpc": Strategy(
        mpc.solve, "20 s ahead, or --horizon", _HYBRID, causal=True, usual=False, previews=True
    ),
    "a_ecms": Strategy(a_ecms.solve, "past and present", _HYBRID, causal=True, usual=False),
    "sdp": Strategy(
        sdp.solve, "past and present; other cycles", _HYBRID, causal=True, usual=False, learns=True
    ),
}


def strategy_named(name: str) -> Strategy:
    """The strategy of a name; DataError with the close matches otherwise."""
    if name not in STRATEGIES:
        raise unknown_name("strategy", name, list(STRATEGIES))
    return STRATEGIES[name]


def fitting(functions: frozenset[str], *, every: bool = False) -> list[str]:
    """Names of the strategies that make sense for an architecture's functions: the usual ones, or every one."""
    return [
        name
        for name, strategy in STRATEGIES.items()
        if strategy.needs <= functions
        and not strategy.excludes & functions
        and (every or strategy.usual)
    ]
