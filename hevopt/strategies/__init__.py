"""All strategies by name: Problem to Plan. A new strategy is one file and one line here; users bring their own by
`register`, or with the call that uses them.
"""

from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from hevopt.errors import DataError, unknown_name
from hevopt.problem.problem import Plan
from hevopt.strategies.brought import (
    FORMS,
    Elsewhere,
    Guarded,
    Located,
    check_name,
    claims_causal,
    is_reference,
    located,
    pairs_of,
    place_of,
)
from hevopt.strategies.installed import installed
from hevopt.strategies.policy import asked_of
from hevopt.strategies.stepper import Stepper


class Strategy(NamedTuple):
    """How to solve, what is known while driving, and the functions (Table 1) an architecture needs for it.

    causal: decides each step without knowing more of the cycle than `knows` says
    usual: part of a comparison that names no strategies
    previews: takes horizon_s; learns: takes training, problems of the same car on other cycles
    start: makes a stepper of a problem, with the settings that solve takes; None where it plans all at once
    start_on: makes one of a problem, and of operating points of the car that are asked for in any order, every so
    many seconds; None where it has to know the step
    place: where a strategy of the user's stands, None for the shipped ones and where no other process finds it
    """

    solve: Callable[..., Plan]
    knows: str = "not said"
    needs: frozenset[str] = frozenset()
    excludes: frozenset[str] = frozenset()
    causal: bool = False
    usual: bool = True
    previews: bool = False
    learns: bool = False
    start: Callable[..., Stepper] | None = None
    start_on: Callable[..., Stepper] | None = None
    place: Located | None = None


_HYBRID = frozenset({"power_management"})
_STOP = frozenset({"start_stop"})
_NONE: frozenset[str] = frozenset()
# A car without an engine: nothing to start and to shift, whose charge ends as it is driven.
_ELECTRIC = frozenset({"electric"})
_RULE = "present step; its parameters are calibrated on the cycle"
# Whether it holds the engine on comes from the steps before.
_HYSTERESIS = "past and present; its parameters are calibrated on the cycle"


class _Shipped:
    """A function of a shipped strategy; its module, and the loops in it, are loaded when it is asked for."""

    def __init__(self, strategy: str, function: str) -> None:
        self._strategy, self._function = strategy, function

    @property
    def __wrapped__(self) -> Any:
        return getattr(import_module(f"{__name__}.{self._strategy}"), self._function)

    def __call__(self, *given: Any, **settings: Any) -> Any:
        return self.__wrapped__(*given, **settings)


STRATEGIES: dict[str, Strategy] = {
    "baseline": Strategy(
        _Shipped("baseline", "solve"),
        "present step",
        _NONE,
        _STOP | _HYBRID,
        causal=True,
        start=_Shipped("baseline", "start"),
    ),
    "start_stop": Strategy(
        _Shipped("start_stop", "solve"),
        _RULE,
        _STOP,
        _HYBRID,
        start=_Shipped("start_stop", "start"),
    ),
    "conventional": Strategy(
        _Shipped("conventional", "solve"),
        _RULE,
        _HYBRID,
        _ELECTRIC,
        start=_Shipped("conventional", "start"),
        start_on=_Shipped("conventional", "start_on"),
    ),
    "nox_cut": Strategy(
        _Shipped("nox_cut", "solve"),
        _RULE,
        _HYBRID | {"nox_cut"},
        _ELECTRIC,
        start=_Shipped("nox_cut", "start"),
        start_on=_Shipped("nox_cut", "start_on"),
    ),
    "power_follower": Strategy(
        _Shipped("power_follower", "solve"),
        _HYSTERESIS,
        _HYBRID | {"free_engine_speed"},
        start=_Shipped("power_follower", "start"),
        start_on=_Shipped("power_follower", "start_on"),
    ),
    "thermostat": Strategy(
        _Shipped("thermostat", "solve"),
        _HYSTERESIS,
        _HYBRID | {"series"},
        start=_Shipped("thermostat", "start"),
        start_on=_Shipped("thermostat", "start_on"),
    ),
    "ecms": Strategy(_Shipped("ecms", "solve"), "whole cycle", _STOP),
    "dp": Strategy(_Shipped("dp", "solve"), "whole cycle", _STOP),
    "convex": Strategy(_Shipped("convex", "solve"), "whole cycle", _HYBRID, _ELECTRIC, usual=False),
    "mpc": Strategy(
        _Shipped("mpc", "solve"),
        "20 s ahead, or --horizon",
        _HYBRID,
        _ELECTRIC,
        causal=True,
        usual=False,
        previews=True,
        start=_Shipped("mpc", "start"),
    ),
    "a_ecms": Strategy(
        _Shipped("a_ecms", "solve"),
        "past and present",
        _HYBRID,
        _ELECTRIC,
        causal=True,
        usual=False,
        start=_Shipped("a_ecms", "start"),
        start_on=_Shipped("a_ecms", "start_on"),
    ),
    "sdp": Strategy(
        _Shipped("sdp", "solve"),
        "past and present; other cycles",
        _HYBRID,
        _ELECTRIC,
        causal=True,
        usual=False,
        learns=True,
        start=_Shipped("sdp", "start"),
        start_on=_Shipped("sdp", "start_on"),
    ),
}


_NO_OTHERS: Mapping[str, Strategy] = {}
_registered: dict[str, Strategy] = {}


def every_strategy() -> dict[str, Strategy]:
    """The shipped strategies, those of installed packages, and those that were registered."""
    places, _ = installed(tuple(STRATEGIES))
    return STRATEGIES | {name: brought(name, place) for name, place in places.items()} | _registered


def left_out() -> tuple[str, ...]:
    """Strategies that installed packages name and that have no place here, each with why."""
    return installed(tuple(STRATEGIES))[1]


def strategy_named(name: str, others: Mapping[str, Strategy] = _NO_OTHERS) -> Strategy:
    """The strategy of a name, shipped, installed, registered or of some others; DataError with close matches."""
    known = {**every_strategy(), **others}
    if name not in known:
        raise unknown_name("strategy", name, list(known))
    return known[name]


def register(
    name: str,
    solve: Callable[..., Any] | Strategy | str,
    *,
    causal: bool = False,
    knows: str = "not said",
    usual: bool = False,
) -> None:
    """Make a strategy of your own known by a name: to `compare`, fronts, sensitivities, sweeps and pages.

    solve: a function from Problem to (time,) control indices or a Plan; a `policy`, which is asked step by step;
    FILE.py:FUNCTION or MODULE:FUNCTION, imported when it is first used; or a Strategy, which says the rest itself
    causal: decides each step without knowing more of the cycle than `knows` says, as policies always declare; where
    its decisions show that they do know more, a comparison does not mark it, and says so
    usual: part of a comparison that names no strategies
    What it returns is driven by `simulate`: whatever it does wrong is a failed row with one message. A name
    that is registered again stands for the new one. DataError for the name of a shipped one, or where there is no
    such function.
    """
    _registered[check_name(name, STRATEGIES)] = brought(
        name, solve, causal=causal, knows=knows, usual=usual
    )


def brought(name: str, what: Any, **marks: Any) -> Strategy:
    """A user's function, reference or Strategy as a strategy of that name; marks: fields of Strategy."""
    check_name(name, STRATEGIES)
    place = None
    if isinstance(what, Strategy):
        what, marks = what.solve, what._asdict()
    if isinstance(what, str | Located):
        place = located(what) if isinstance(what, str) else what
        what = Elsewhere(place)
    if not callable(what):
        raise DataError(
            f"strategy {name}: a {type(what).__name__} is no function; needed: a function from Problem to control "
            f"indices or a Plan, or {FORMS}"
        )
    place = place_of(what) if place is None else place
    guarded = Guarded(name, what)
    stepped = isinstance(what, Elsewhere) or asked_of(what) is not None
    start = guarded.start if stepped else None
    return Strategy(**marks | {"solve": guarded, "place": place, "start": start})


def is_causal(strategy: Strategy) -> bool:
    """Whether a strategy says not to know the rest of the cycle; one that stands elsewhere is imported."""
    return strategy.causal or claims_causal(strategy.solve)


def chosen(wanted: Any, folder: Path | None = None) -> tuple[list[str] | None, dict[str, Strategy]]:
    """The names of what users want, None for the usual ones, and the strategies that they bring along by some.

    wanted: a name, a list of names and pairs (name, function), or a mapping of name to function; a name may be
    FILE.py:FUNCTION or MODULE:FUNCTION. folder: from where files are taken
    """
    pairs = pairs_of(wanted)
    if pairs is None:
        return None, {}
    own = {name: brought(name, what) for name, what in pairs if what is not None}
    known = every_strategy().keys() | own.keys()
    for name, _ in pairs:
        if isinstance(name, str) and is_reference(name) and name not in known:
            own[name] = brought(name, located(name, folder))
    return [name for name, _ in pairs], own


def policies(references: Sequence[str]) -> dict[str, Strategy]:
    """Strategies by the names of their functions; by the reference where that name is taken, or given twice.

    references: each FILE.py:FUNCTION or MODULE:FUNCTION. They are part of every comparison they are given to.
    """
    places = {reference: located(reference) for reference in dict.fromkeys(references)}
    short = [place.function for place in places.values()]
    own = {}
    for reference, place in places.items():
        alone = short.count(place.function) == 1 and place.function not in every_strategy()
        name = place.function if alone and place.function not in ("all", "bound") else reference
        own[name] = brought(name, place, usual=True)
    return own


def fitting(functions: frozenset[str], *, every: bool = False) -> list[str]:
    """Names of the strategies that make sense for an architecture's functions or `marks`: the usual ones, or every
    one."""
    return [
        name
        for name, strategy in every_strategy().items()
        if strategy.needs <= functions
        and not strategy.excludes & functions
        and (every or strategy.usual)
    ]
