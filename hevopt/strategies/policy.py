"""Policies: functions that are asked step by step, and shown what they declare to know."""

from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar, overload

from hevopt.errors import DataError, SolverError
from hevopt.problem.problem import Problem
from hevopt.strategies.stepwise import AskedRule

PREVIEW_MAX = 100_000
_MARK = "_hevopt_policy"
Rule = TypeVar("Rule", bound=Callable[..., Any])


class Declared(NamedTuple):
    """What a policy has declared. preview: steps after the present one that it is shown"""

    preview: int = 0


@overload
def policy(rule: Rule) -> Rule: ...
@overload
def policy(*, preview: int) -> Callable[[Rule], Rule]: ...
def policy(rule: Rule | None = None, *, preview: int = 0) -> Rule | Callable[[Rule], Rule]:
    """Marks a function as a policy: it gets a `Step`, every step anew, and returns the index of a control.

    preview: steps after the present one that it is shown, as `Step.ahead`
    Also of a class, which is made anew for every drive, without arguments, and remembers what it likes. DataError
    for a preview that is no number of steps.
    """
    if isinstance(preview, bool) or not isinstance(preview, int) or not 0 <= preview <= PREVIEW_MAX:
        raise DataError(
            f"policy: preview = {repr(preview)[:40]}; needed: a number of steps, 0 to {PREVIEW_MAX}"
        )

    def marked(what: Rule) -> Rule:
        try:
            setattr(what, _MARK, Declared(preview))
        except AttributeError:
            raise DataError(
                f"policy: a {type(what).__name__} cannot be marked; needed: a function or a class"
            ) from None
        return what

    return marked if rule is None else marked(rule)


def asked_of(function: Any) -> Declared | None:
    """What a function has declared to know as a policy; None where it is none, and gets the whole Problem."""
    declared = getattr(function, _MARK, None)
    return declared if isinstance(declared, Declared) else None


def asking(problem: Problem, rule: Callable[..., Any], asked: Declared) -> AskedRule:
    """A policy as a stepper of a problem, a class made anew."""
    own = rule() if isinstance(rule, type) else rule
    if not callable(own):
        raise SolverError(f"the policy {own.__class__.__name__} has no __call__(now)")
    return AskedRule(problem, own, asked.preview)
