"""Strategies of installed packages: those that name a function in the entry-point group hevopt.strategies."""

from collections.abc import Mapping
from functools import lru_cache
from importlib.metadata import entry_points
from pathlib import Path

from hevopt.errors import DataError
from hevopt.strategies.brought import Located, check_name, located

GROUP = "hevopt.strategies"


@lru_cache
def installed(shipped: tuple[str, ...]) -> tuple[Mapping[str, Located], tuple[str, ...]]:
    """Name -> where the function stands, and why others are left out: a name that is taken, or no name.

    None of the packages is imported here, but for what lies above a module; what cannot be is told when it is used.
    """
    found: dict[str, Located] = {}
    faults = []
    for point in sorted(entry_points(group=GROUP), key=lambda point: (point.name, point.value)):
        try:
            name = check_name(point.name, (*shipped, *found))
        except DataError as error:
            faults.append(f"{point.value}: {error}")
            continue
        try:
            found[name] = located(point.value)
        except DataError:
            found[name] = Located(point.module, Path(point.module), point.attr)
    return found, tuple(faults)
