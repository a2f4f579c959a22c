"""The compiled loop that a car is driven by: with clutch and gears, or of an engine that has a speed of its own."""

from typing import Any

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.forward import _drive_kernels as geared
from hevopt.forward import _free_loop_kernels as free
from hevopt.forward._acting_kernels import LoopCar, LoopTask
from hevopt.forward._free_kernels import FreeCar, FreeCourse, begins_radps
from hevopt.forward.breathing import EngineModel, breathing_of
from hevopt.forward.limits import motors_of
from hevopt.forward.lines import Line
from hevopt.problem.arrays import Array


class Driving:
    """One car on one task; what lies between two steps is a `Loop` or a `FreeLoop`.

    start_radps: speed at which the engine turns, or would if it did, as the task begins
    start_mps: speed of the car as it begins; course: None but of an engine that has a speed of its own
    DataError for an engine model that is none, or that the car has no data for.
    """

    def __init__(
        self,
        car: Architecture,
        line: Line,
        start_mps: float,
        driven: LoopCar,
        task: LoopTask,
        course: FreeCourse | None,
        engine_model: EngineModel = "map",
    ) -> None:
        self._driven, self._task, self.course = driven, task, course
        self._work = geared.work_of(driven.ways)
        idle = car.engine.idle_radps
        turns = line.ways.wheel[task.way[0], -1] * start_mps
        self._start = float(max(idle, turns / car.vehicle.tyre_radius_m))
        self._free = None if line.free is None else free_car(car, line, driven)
        self.breathing = breathing_of(car, engine_model, self.start_radps)

    @property
    def start_radps(self) -> float:
        """Speed at which the engine turns, or would if it did, as the task begins."""
        if self._free is None or self.course is None:
            return self._start
        return float(begins_radps(self._free, self.course, float(self._task.speed_mps[0])))

    def begun(self, start_j: float) -> Any:
        """The loop before its first step, with a stored energy."""
        if self._free is not None and self.course is not None:
            return free.begun(self._free, self._task, self.course, start_j)
        return geared.begun(self._driven, self._task, start_j)

    def seen(self, loop: Any, at_s: float, for_s: float, step_s: float) -> geared.Look:
        """What a decision sees that holds for a time."""
        return geared.seen(self._driven, self._task, loop, at_s, for_s, step_s)

    def advance(self, loop: Any, first: int, record: Array, step_s: float) -> Any:
        """The loop after some more steps, `first` of them being the first; record: filled."""
        if self._free is not None and self.course is not None:
            march = free.advance if self.breathing is None else self.breathing.advance_free
            return march(
                self._free, self._task, self.course, self._work, loop, first, record, step_s
            )
        advance = geared.advance if self.breathing is None else self.breathing.advance
        return advance(self._driven, self._task, self._work, loop, first, record, step_s)


def free_car(car: Architecture, line: Line, driven: LoopCar) -> FreeCar:
    """A car whose engine has a speed of its own, as its loop reads it."""
    assert line.free is not None  # as the engine has
    lowest = float(car.engine.law.lowest_nm)
    return FreeCar(driven, motors_of(car), line.free.governor, line.free.driving, lowest)


def empty_course(line: Line, decisions: int, machines: int) -> FreeCourse | None:
    """A course to be filled decision by decision; None without an engine that has a speed of its own."""
    if line.free is None:
        return None
    return FreeCourse(
        np.zeros(decisions),
        np.zeros(decisions),
        np.zeros((decisions, machines)),
        np.zeros(decisions, dtype=bool),
    )
