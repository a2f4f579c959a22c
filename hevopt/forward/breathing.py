"""The mean-value engine in the driven car: where its gas begins, how finely it is marched, what it leaves."""

from collections.abc import Iterator
from typing import Literal, get_args

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.car_files.mean_value_parts import mean_value_of
from hevopt.errors import DataError, SolverError
from hevopt.forward import _breathing_kernels as col
from hevopt.forward._acting_kernels import LoopCar, LoopTask
from hevopt.forward._drive_kernels import Loop, Work
from hevopt.forward._free_kernels import FreeCar, FreeCourse
from hevopt.forward._free_loop_kernels import FreeLoop
from hevopt.forward._pull_kernels import Foot, Pull, PullWork
from hevopt.mean_value._run_kernels import TABLEAUX
from hevopt.mean_value.car import BENCH, model_of
from hevopt.mean_value.parameters import FULL_LOAD, Diesel, Drive, curve_of
from hevopt.mean_value.run import STEP_S
from hevopt.mean_value.settle import steady_state
from hevopt.mean_value.stability import longest_step_s
from hevopt.problem.arrays import Array, Indices

EngineModel = Literal["map", "mean_value"]
ENGINE_MODELS = get_args(EngineModel)

_GUARD_EVERY_S = 1.0
_PARTS_MAX = 100_000


class Breathing:
    """The gas of a car's engine while this is driven, begun settled at an engine speed and torque.

    DataError for a car whose engine has no mean_value part, SolverError where the engine does not settle.
    """

    def __init__(self, car: Architecture, side_radps: float, torque_nm: float = 0.0) -> None:
        diesel = diesel_of(car)
        self._model = model_of(diesel, BENCH, Drive(held=1.0))
        full = float(np.interp(side_radps, *curve_of(diesel.curves, FULL_LOAD)))
        given = self._model._replace(drive=Drive(held=1.0, torque_nm=torque_nm))
        pedal = min(max(torque_nm / full, 0.0), 1.0)
        self._gas = steady_state(given, side_radps, pedal=pedal)
        self._found: list[Array] = []
        self._parts, self._left = 1, 0

    def advance(
        self, car: LoopCar, task: LoopTask, work: Work, loop: Loop, first: int, record: Array, step_s: float
    ) -> Loop:  # fmt: skip
        """The loop after some more steps, as `_drive_kernels.advance` with the steady map."""
        for done, part, air, breath in self._pieces(record, step_s):
            loop = col.advance_breathing(
                car, task, work, loop, first + done, part, step_s, air, self._gas, breath
            )
        return loop

    def advance_free(
        self, car: FreeCar, task: LoopTask, course: FreeCourse, work: Work, loop: FreeLoop, first: int,
        record: Array, step_s: float,
    ) -> FreeLoop:  # fmt: skip
        """The loop after some more steps, as `_free_loop_kernels.advance` with the steady map."""
        for done, part, air, breath in self._pieces(record, step_s):
            loop = col.advance_free_breathing(
                car, task, course, work, loop, first + done, part, step_s, air, self._gas, breath
            )
        return loop

    def pull(
        self, car: LoopCar, by_gear: Indices, foot: Foot, work: PullWork, moved: Pull, step_s: float, record: Array
    ) -> Pull:  # fmt: skip
        """The car at full pedal after some more steps."""
        for _, part, air, breath in self._pieces(record, step_s):
            moved = col.pull_breathing(
                car, by_gear, foot, work, moved, step_s, part, air, self._gas, breath
            )
        return moved

    def _pieces(self, record: Array, step_s: float) -> Iterator[tuple[int, Array, col.Air, Array]]:
        """A record up to each look at the guard: steps before, the piece, how it is marched, and room for what it
        leaves behind."""
        done = 0
        while done < len(record):
            if self._left == 0:
                self._left = max(round(_GUARD_EVERY_S / step_s), 1)
                self._parts = self._parts_of(step_s)
            count = min(len(record) - done, self._left)
            self._left -= count
            breath = np.zeros((count, col.COLUMNS))
            self._found.append(breath)
            air = col.Air(self._model, *TABLEAUX[4], self._parts)
            yield done, record[done : done + count], air, breath
            done += count

    def _parts_of(self, step_s: float) -> int:
        """In how many steps the gas as it is now marches one of the car."""
        longest = min(longest_step_s(0.0, self._gas, self._model), STEP_S)
        if not longest * _PARTS_MAX > step_s:  # nor NaN
            raise SolverError(
                f"the engine's gas asks for steps of {longest:.2g} s; check volumes, areas and pressure losses "
                "of its file"
            )
        return int(np.ceil(step_s / longest - 1e-9))

    @property
    def breath(self) -> Array:
        """(step, column) what the steps so far have left behind, see _breathing_kernels."""
        return np.concatenate(self._found)


def diesel_of(car: Architecture) -> Diesel:
    """A car's mean-value engine; DataError for a car without one."""
    if car.electric:
        raise DataError(f"{car.name}: it has no engine; leave --engine-model mean_value out")
    return mean_value_of(f"{car.source}, engine", car.contents["engine"])


def check_engine_model(car: Architecture, engine_model: str) -> None:
    """DataError for a model of the engine that is none, or that this car has no data for."""
    if engine_model not in ENGINE_MODELS:
        raise DataError(f"engine model {engine_model!r}; allowed: {', '.join(ENGINE_MODELS)}")
    if engine_model == "mean_value":
        diesel_of(car)


def breathing_of(
    car: Architecture, engine_model: str, side_radps: float, torque_nm: float = 0.0
) -> Breathing | None:
    """The gas of an engine that turns at a speed with a torque; None for the steady map."""
    check_engine_model(car, engine_model)
    return Breathing(car, side_radps, torque_nm) if engine_model == "mean_value" else None
