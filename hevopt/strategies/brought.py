"""Strategies that users bring, by a name of their own: a function from Problem to control indices or a Plan, or a
policy, which is asked step by step.

Whatever such a function does, its callers get a plan that `simulate` has driven, or an error of this package that
names the strategy: it may raise, return something else, a wrong length, NaN or a control that cannot be used.
"""

import hashlib
import importlib
import importlib.util
import sys
import traceback
from collections.abc import Callable, Iterable, Mapping
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

from hevopt.errors import (
    DataError,
    HevoptError,
    InfeasibleError,
    SolverError,
    comes_from_interrupt,
)
from hevopt.problem.arrays import Indices
from hevopt.problem.problem import Plan, Problem
from hevopt.strategies.causality import peeks
from hevopt.strategies.policy import asked_of, asking
from hevopt.strategies.stepper import driven
from hevopt.strategies.stepwise import AskedRule

NAME_MAX = 80
_SAID_MAX = 500
# Names of modules that were imported from files on their own begin so.
_OWN = "hevopt_strategy_"
_PACKAGE = str(Path(__file__).resolve().parents[1])
FORMS = "FILE.py:FUNCTION or MODULE:FUNCTION"


class Guarded(NamedTuple):
    """A brought function whose plans can be driven; it raises InfeasibleError where the function does, and
    SolverError for whatever else goes wrong with it.
    """

    name: str
    function: Callable[..., Any]

    def __call__(self, problem: Problem, **settings: Any) -> Plan:
        try:
            found = self._planned(problem, settings)
        except HevoptError as error:
            kind = InfeasibleError if isinstance(error, InfeasibleError) else SolverError
            raise kind(f"strategy {self.name}: {error}") from error
        except (Exception, SystemExit) as error:
            if comes_from_interrupt(error):
                raise
            raise SolverError(
                f"strategy {self.name} raised {type(error).__name__}: {_said(error)}{_place(error)}"
                f"{self._hint(error)}"
            ) from error
        from hevopt.problem.simulation import simulate

        plan = found.control if isinstance(found, Plan) else found
        if not isinstance(plan, list | tuple | np.ndarray):
            what = "nothing" if plan is None else f"a value of type {type(plan).__name__}"
            raise SolverError(
                f"strategy {self.name}: it returned {what}; needed: (time,) control indices, or a Plan"
            )
        try:
            return Plan(simulate(problem, plan).control)
        except InfeasibleError as error:
            raise SolverError(f"strategy {self.name}: {error}") from None

    @property
    def resolved(self) -> Callable[..., Any]:
        """The function itself, imported if it stands elsewhere."""
        return self.function.found if isinstance(self.function, Elsewhere) else self.function

    def _planned(self, problem: Problem, settings: Mapping[str, Any]) -> Any:
        function = self.resolved
        asked = asked_of(function)
        if asked is None:
            return function(problem, **settings)
        if settings:
            raise DataError(f"a policy takes no settings; found {', '.join(settings)}")
        return driven(problem, asking(problem, function, asked))[0]

    def _hint(self, error: BaseException) -> str:
        if isinstance(error, AttributeError | TypeError) and asked_of(self.resolved) is None:
            return "; it was given the whole Problem: @hevopt.policy marks a function to be asked step by step"
        return ""

    def start(self, problem: Problem) -> AskedRule:
        """A policy as a stepper; SolverError for a function that plans the whole problem."""
        function = self.resolved
        asked = asked_of(function)
        if asked is None:
            raise SolverError(
                f"strategy {self.name} plans the whole problem, and cannot be asked step by step; @hevopt.policy "
                "marks a function that can"
            )
        return asking(problem, function, asked)

    def why_not_causal(self, problem: Problem, control: Indices) -> str | None:
        """What its decisions show to know of a future that it declares not to know; None for nothing."""
        return peeks(problem, control, self.resolved)


def claims_causal(solve: Callable[..., Any]) -> bool:
    """Whether a brought strategy is a policy by its own declaration, imported for it if need be."""
    return isinstance(solve, Guarded) and asked_of(solve.resolved) is not None


def _said(error: BaseException) -> str:
    text = str(error)
    return text if len(text) <= _SAID_MAX else f"{text[:_SAID_MAX]} ..."


def _place(error: BaseException) -> str:
    """The line that raised, of the user's code where it is known."""
    lines = traceback.extract_tb(error.__traceback__)[1:]
    own = [line for line in lines if not line.filename.startswith(_PACKAGE)] or lines
    return f" ({Path(own[-1].filename).name}, line {own[-1].lineno})" if own else ""


def check_name(name: Any, shipped: Iterable[str]) -> str:
    """DataError where a name cannot be that of a brought strategy."""
    taken = (*shipped, "all", "bound")
    if not isinstance(name, str) or not name.isprintable() or not name.strip() or "," in name:
        raise DataError(
            f"strategy name {name!r}; needed: text on one line, without commas, such as 'thermostat'"
        )
    if len(name) > NAME_MAX or name in taken:
        why = f"allowed: up to {NAME_MAX} characters" if len(name) > NAME_MAX else "it is taken"
        raise DataError(f"strategy name {name[:NAME_MAX]!r}: {why}; choose another")
    return name


def is_reference(text: str) -> bool:
    """Whether a text is meant as FILE.py:FUNCTION or MODULE:FUNCTION."""
    return ":" in text


class Located(NamedTuple):
    """Where a function stands. module: its name, or '' for that of a file on its own; file: its source."""

    module: str
    file: Path
    function: str

    @property
    def reference(self) -> str:
        """What finds it again from another process."""
        return f"{self.module or self.file}:{self.function}"


def located(reference: str, folder: Path | None = None) -> Located:
    """Where the function of a reference stands, without running the file.

    folder: from where a file's path is taken. DataError where there is no such file or module.
    """
    place, _, function = reference.rpartition(":")
    if not place or not all(part.isidentifier() for part in function.split(".")):
        raise DataError(f"strategy {reference!r}; needed: {FORMS}")
    if place.endswith(".py"):
        file = (folder or Path()) / Path(place).expanduser()
        if not file.is_file():
            raise DataError(f"strategy {reference!r}: {file} not found; needed: {FORMS}")
        return Located("", file.absolute(), function)
    try:
        found = importlib.util.find_spec(place)
    except (ImportError, ValueError, AttributeError):
        found = None
    if found is None or found.origin is None or not Path(found.origin).is_file():
        raise DataError(
            f"strategy {reference!r}: module {place!r} cannot be imported; needed: {FORMS}, the module "
            "installed or on PYTHONPATH"
        )
    return Located(place, Path(found.origin), function)


class Elsewhere(NamedTuple):
    """A function that is imported when it is first called."""

    place: Located

    @property
    def found(self) -> Callable[..., Any]:
        """The function; SolverError where its file raises or has no such function."""
        return _imported(self.place)

    def __call__(self, problem: Problem, **settings: Any) -> Any:
        return self.found(problem, **settings)


def _imported(place: Located) -> Callable[..., Any]:
    """The function that stands there; SolverError where its file raises or has no such function."""
    try:
        module = (
            importlib.import_module(place.module)
            if place.module
            else _of_file(place.file, place.file.stat().st_mtime_ns)
        )
        function: Any = module
        for part in place.function.split("."):
            function = getattr(function, part)
    except (Exception, SystemExit) as error:
        if comes_from_interrupt(error):
            raise
        raise SolverError(
            f"strategy {place.file.name}:{place.function} cannot be imported: {type(error).__name__}: "
            f"{_said(error)}{_place(error)}"
        ) from error
    if not callable(function):
        raise SolverError(f"strategy {place.file.name}:{place.function} is no function")
    found: Callable[..., Any] = function
    return found


@lru_cache(maxsize=64)
def _of_file(file: Path, changed_ns: int) -> ModuleType:
    """The module of a file, imported once in a process as it stands, its own folder on the path as for a script."""
    name = f"{_OWN}{file.stem}_{hashlib.sha256(str(file).encode()).hexdigest()[:12]}"
    spec = importlib.util.spec_from_file_location(name, file)
    if spec is None or spec.loader is None:
        raise ImportError(f"{file} is no Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    if str(file.parent) not in sys.path:
        sys.path.append(str(file.parent))
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module


def place_of(function: Callable[..., Any]) -> Located | None:
    """Where another process finds a function; None where it cannot: a lambda, an inner one, one of a notebook."""
    module, name = getattr(function, "__module__", None), getattr(function, "__qualname__", "")
    if module in (None, "__main__") or module not in sys.modules:
        return None
    found: Any = sys.modules[module]
    for part in name.split("."):
        found = getattr(found, part, None)
    file = getattr(sys.modules[module], "__file__", None)
    if found is not function or file is None:
        return None
    own = module.startswith(_OWN)
    return Located("" if own else module, Path(file).absolute(), name)


def pairs_of(wanted: Any) -> list[tuple[str, Any]] | None:
    """(name, what was brought by it) of what users name: a name, a list of names and pairs, or a mapping; None
    beside a name that must be known already.
    """
    if wanted is None:
        return None
    if isinstance(wanted, str):
        return [(wanted, None)]
    if isinstance(wanted, Mapping):
        return list(wanted.items())
    pairs = []
    for entry in wanted if isinstance(wanted, Iterable) else [wanted]:
        pair = (entry, None) if isinstance(entry, str) else entry
        if not (isinstance(pair, tuple) and len(pair) == 2):
            raise DataError(
                f"strategies: found {type(entry).__name__} {str(entry)[:40]!r}; needed: a name, a list of names "
                "and pairs (name, function), or a mapping of name to function"
            )
        pairs.append(pair)
    return pairs
