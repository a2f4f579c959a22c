"""What flows through the parts of a car, by name: of every control at every step, or of one plan."""

from abc import abstractmethod
from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import ArrayLike

from hevopt.display.facts import Shown
from hevopt.problem.arrays import Array, Indices
from hevopt.problem.cells import SplitCells, TableFigures
from hevopt.problem.frozen import frozen


class Flows(Mapping[str, Array], Shown):
    """name -> (time, control) powers, speeds and torques."""

    __slots__ = ()

    def _facts(self) -> dict[str, object]:
        return {"flows": list(self)}

    def cells(self, figures: TableFigures, *, nox: bool = True) -> SplitCells | None:
        """What is known between neighbours of the table whose flows these are; None where nothing is.

        nox: without it nothing is said of NOx, whose lines may be 0
        """
        return None

    @abstractmethod
    def along(self, control: Indices) -> dict[str, Array]:
        """name -> (time,) of one control per step."""


class GivenFlows(Flows):
    """Arrays as they were given, copied so that nobody can change them."""

    __slots__ = ("_flows",)

    def __init__(self, flows: Mapping[str, ArrayLike], place: str = "") -> None:
        self._flows = {name: frozen(f"{place}flows {name}", flow) for name, flow in flows.items()}

    def __getitem__(self, name: str) -> Array:
        return self._flows[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._flows)

    def __len__(self) -> int:
        return len(self._flows)

    def along(self, control: Indices) -> dict[str, Array]:
        steps = np.arange(len(control))
        return {name: flow[steps, control] for name, flow in self._flows.items()}
