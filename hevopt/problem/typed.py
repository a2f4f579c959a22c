"""Compiled loops that are called over and over with arguments of the same types: the types are looked at once."""

from collections.abc import Callable
from typing import Any, TypeVar

from numba.core.dispatcher import Dispatcher

_Loop = TypeVar("_Loop", bound=Callable[..., Any])


def typed(loop: _Loop, *arguments: object) -> _Loop:
    """A loop for arguments of the types of these; the loop itself where loops are not compiled.

    Looking at tuples of many arrays takes longer than a short loop. Nobody looks any more: whoever calls keeps to
    these types.
    """
    if not isinstance(loop, Dispatcher):
        return loop
    found: Any = loop.compile(tuple(loop.typeof_pyval(argument) for argument in arguments))
    made: _Loop = found
    return made
