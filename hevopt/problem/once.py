"""What is computed once for a problem, however many ask for it."""

from collections.abc import Callable
from functools import wraps
from typing import TypeVar
from weakref import WeakKeyDictionary

Frozen = TypeVar("Frozen")
Result = TypeVar("Result")


def once(function: Callable[[Frozen], Result]) -> Callable[[Frozen], Result]:
    """Decorator for a function of one thing that cannot change: its result is kept as long as that thing is.

    All who ask share the result, so that none of them may change it. Errors are not kept.
    """
    kept: WeakKeyDictionary[Frozen, Result] = WeakKeyDictionary()

    @wraps(function)
    def shared(of: Frozen) -> Result:
        if of not in kept:
            kept[of] = function(of)
        return kept[of]

    return shared
