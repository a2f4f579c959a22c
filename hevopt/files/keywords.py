"""The keywords of a function, checked before it is called: a wrong one is answered with those that there are."""

import inspect
from collections.abc import Callable, Mapping
from numbers import Real
from types import NoneType
from typing import Any, get_args

import numpy as np

from hevopt.errors import DataError, unknown_name
from hevopt.files.shown import printable, shown


def check_keywords(place: str, function: Callable[..., Any], given: Mapping[str, Any]) -> None:
    """DataError where a function does not take a keyword, or needs one that is not given."""
    own = list(inspect.signature(function).parameters.values())[1:]
    if any(parameter.kind is parameter.VAR_KEYWORD for parameter in own):
        return
    known = [parameter.name for parameter in own]
    for name in given:
        if name not in known:
            if not known:
                raise DataError(f"{place}: setting {printable(name)!r}; there is none")
            raise DataError(f"{place}: {unknown_name('setting', printable(name), known)}")
        _check_number(place, name, own[known.index(name)].annotation, given[name])
    missing = [p.name for p in own if p.default is p.empty and p.name not in given]
    if missing:
        raise DataError(f"{place} needs {', '.join(missing)}; give it as a keyword")


def _check_number(place: str, name: str, kind: Any, value: Any) -> None:
    """DataError where a parameter is annotated as a number, or none, and the value is neither."""
    kinds = set(get_args(kind) or [kind])
    if kinds <= {int, float, bool, NoneType} and not (
        isinstance(value, Real | np.bool_) or (value is None and NoneType in kinds)
    ):
        raise DataError(f"{place}: {name} = {shown(value)}; needed: a number")
