"""A car driven along a trace by a driver at the pedals, engine and machine by a strategy that is asked on the way.

At every decision the strategy is told what is stored and, as a row of a control table, where the car is: the
operating point nearest to the gear, the speed and the torque at the wheels that the driver asks for, or the step
of the cycle for a strategy that looks ahead along it. What it decides holds until the next decision: the engine on
or off, gears beside the listed one, and while the engine drives the machine's torque, of which the engine gives the
rest. Gears and clutch are the driver's, as in a replayed plan.
"""

import ctypes
from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.car.driveline import State
from hevopt.car.handling import Handling
from hevopt.driving.cycle import Cycle
from hevopt.errors import DataError, InfeasibleError
from hevopt.forward import _drive_kernels as col
from hevopt.forward._acting_kernels import LoopTask
from hevopt.forward._asks_kernels import Asked, Asks
from hevopt.forward.breathing import EngineModel
from hevopt.forward.lines import Line, line_of
from hevopt.forward.loops import Driving, empty_course
from hevopt.forward.plans import ForwardPlan, driver_gears, flows_of, runs_free, signals_of
from hevopt.forward.run import (
    STEP_S,
    ForwardRun,
    loop_car,
    run_of,
    steps_of,
    task_of,
    whole_handling,
)
from hevopt.powertrain.points import OperatingPoints
from hevopt.problem.arrays import Array, Flags
from hevopt.problem.battery import soc
from hevopt.problem.holding import turning_modes
from hevopt.problem.problem import Problem, Trajectory
from hevopt.strategies.stepper import Stepper

_INTERVALS_S = (0.02, 10.0)
_LONGEST_DWELL_S = 60.0


class Asking(NamedTuple):
    """interval_s: from one decision to the next; dwell_s: least time for which the engine stays on, and off."""

    interval_s: float = 0.5
    dwell_s: float = 1.0

    def check(self) -> None:
        """DataError for a figure out of range."""
        low, high = _INTERVALS_S
        if not low <= self.interval_s <= high:  # nor NaN
            raise DataError(
                f"decisions every {self.interval_s:g} s; allowed: {low:g} to {high:g} s"
            )
        if not 0 <= self.dwell_s <= _LONGEST_DWELL_S:
            raise DataError(f"dwell {self.dwell_s:g} s; allowed: 0 to {_LONGEST_DWELL_S:g} s")


class Decision(NamedTuple):
    """What a decision has the car do; gears: chosen beside the listed one, which it may choose as well, else 0.

    machines_nm: torque of every machine
    engine_radps, engine_nm: of the engine, read where its speed is free or a torque converter slips
    closed: whether a clutch of the strategy is
    """

    engine_on: bool
    machines_nm: Sequence[float]
    engine_radps: float
    engine_nm: float
    listed: int
    gears: tuple[tuple[str, int], ...]
    closed: bool


class Decider:
    """A strategy on its way, and what its decisions mean.

    problem: of which every row is a step or an operating point; points: those, None for the steps of the cycle
    stepper: asked for rows of the problem, and for those of `with_holding` where there are points
    """

    def __init__(
        self,
        name: str,
        stepper: Stepper,
        problem: Problem,
        points: OperatingPoints | None,
        asking: Asking,
    ) -> None:
        self.name, self.stepper, self.asking = name, stepper, asking
        self.problem, self.points = problem, points
        table = problem.table
        flows, columns = flows_of(table)
        self._states = flows.states(columns)
        wanted = [f"{name}_torque_nm" for name in flows.machines]
        self._machines = len(wanted)
        line = flows.car.driveline
        if line.free_engine_speed or line.converter is not None:
            wanted += ["engine_speed_radps", "engine_torque_nm"]
        # (row, control, flow)
        self._wanted = np.moveaxis(flows.several(wanted)[:, :, columns], 0, -1)
        self._turning: list[bool] = turning_modes(problem).tolist()
        self._modes: list[int] = table.mode.tolist()
        self._rows = len(table.step_s)
        on = np.array([state.engine_on for state in self._states])
        self._keeps: list[Flags] = [
            np.asarray(table.feasible[:, on == turns].any(axis=1)) for turns in (False, True)
        ]
        self._mode, self._since_s = problem.start_mode, -np.inf

    def decide(self, at_s: float, k: int, gear: int, look: col.Look, energy_j: float) -> Decision:
        """The command from a time on, in step k of the cycle and a gear; look: what the driver asks for."""
        row = k if self.points is None else self.points.row(gear, *look)
        turns = self._turning[self._mode]
        held = self.points is not None and at_s - self._since_s < self.asking.dwell_s - 1e-9
        asked = row + self._rows if held and self._keeps[turns][row] else row
        try:
            control = self.stepper.decide(asked, energy_j, self._mode)
        except InfeasibleError as error:
            charge = float(soc(self.problem.battery, energy_j))
            raise InfeasibleError(
                f"{self.name}: no decision at t = {at_s:g} s, gear {gear}, {look.speed_mps:.2f} m/s, "
                f"{look.wheel_nm:.0f} Nm at the wheels, SOC {charge:.4f}: {error}"
            ) from None
        self._mode, state = self._modes[control], self._states[control]
        if state.engine_on != turns:
            self._since_s = at_s
        wanted: list[float] = self._wanted[row, control].tolist()
        machines_nm, engine = wanted[: self._machines], wanted[self._machines :]
        radps, engine_nm = engine or (0.0, 0.0)
        closed, gears = bool(state.closed), state.gears
        return Decision(state.engine_on, machines_nm, radps, engine_nm, state.listed, gears, closed)


def follow_asked(
    car: Architecture,
    cycle: Cycle,
    decider: Decider,
    planned: Trajectory,
    *,
    step_s: float = STEP_S,
    handling: Handling | None = None,
    line: Line | None = None,
    engine_model: EngineModel = "map",
) -> ForwardRun:
    """The car driven along the cycle, a strategy deciding on the way.

    planned: the strategy's trajectory on the cycle as the backward model drives it, whose gears the driver takes
    and beside whose charge the run is shown. Errors as of `follow`, InfeasibleError where a decision is impossible.
    """
    line, handling = line or line_of(car), whole_handling(car, handling)
    decider.asking.check()
    exact_s, record = steps_of(cycle, step_s, handling, len(car.machines))
    wanted_s = np.arange(0.0, cycle.duration_s - 1e-9, decider.asking.interval_s)
    begins = np.append(np.unique(np.round(wanted_s / exact_s).astype(np.int64)), len(record))
    from_s = cycle.time_s[0] + exact_s * begins
    # Nothing is planned, so that there is no charge to be kept.
    driver = handling.driver._replace(charge_per_s=0.0)
    orders = _Orders(car, cycle, decider, planned, line, from_s)
    task, course = orders.task, orders.course
    driven = loop_car(car, line, handling._replace(driver=driver), task.load_w)
    start_mps = float(cycle.speed_mps[0])
    driving = Driving(car, line, start_mps, driven, task, course, engine_model)
    loop = driving.begun(float(planned.energy_j[0]))
    orders.decide(0, driving.seen(loop, from_s[0], task.asks.for_s, exact_s), loop.energy_j)
    driving.advance(driving.begun(loop.energy_j), 0, record, exact_s)
    if orders.fault is not None:
        raise orders.fault
    planned_j = np.asarray(planned.energy_j, dtype=np.float64)
    return run_of(car, cycle, task, planned_j, line, handling, record, exact_s, driving)


class _Orders:
    """The task of a loop, filled decision by decision: asked by the loop itself, which hands over no car.

    fault: what went wrong in a decision, upon which the loop has ended
    """

    def __init__(
        self, car: Architecture, cycle: Cycle, decider: Decider, planned: Trajectory, line: Line, from_s: Array
    ) -> None:  # fmt: skip
        self.fault: BaseException | None = None
        self._car = car
        self._decider, self._way, self._order = decider, cache(line.index), line.order
        self._gears, self._step, task = _undecided(car, cycle, from_s, planned)
        self._slips = car.driveline.converter is not None
        self._asked = Asked(self._answer)  # kept, as the loop knows nothing but where it is
        address = ctypes.cast(self._asked, ctypes.c_void_p).value
        assert address is not None  # of a function that is there
        self._told, first = np.zeros(3), np.zeros(1, dtype=np.int64)
        self.task = task._replace(asks=Asks(address, decider.asking.interval_s, first, self._told))
        self.course = empty_course(line, len(from_s) - 1, len(car.machines))

    def decide(self, d: int, look: col.Look, energy_j: float) -> None:
        """The task's step d filled with what is decided."""
        decider, task, course = self._decider, self.task, self.course
        # A step of the driven car may begin a little before the cycle's.
        k = self._step[d] if decider.points is not None else min(d, len(self._gears) - 1)
        gear = self._gears[k]
        command = decider.decide(float(task.from_s[d]), k, gear, look, energy_j)
        task.way[d] = self._way(command.listed or gear, command.gears)
        if self._slips and d > 0 and _coasts(self._car, command, look):
            task.way[d], task.apart[d] = task.way[d - 1], 3
        task.engine_on[d] = command.engine_on
        first, *others = self._order
        task.machine_nm[d] = command.machines_nm[first]
        for n, machine in enumerate(others):
            task.others_nm[d, n] = command.machines_nm[machine]
        if course is not None:
            course.engine_radps[d], course.engine_nm[d] = command.engine_radps, command.engine_nm
            course.machine_nm[d], course.closed[d] = command.machines_nm, command.closed

    def _answer(self, d: int) -> int:
        if self.fault is None:
            speed_mps, wheel_nm, energy_j = self._told.tolist()
            try:
                self.decide(d, col.Look(speed_mps, wheel_nm), energy_j)
                return 0
            except BaseException as fault:  # nothing passes a compiled loop
                self.fault = fault
        # A loop that is driven on in pieces asks again at once, and ends again.
        self.task.asks.last[0] = -1
        return 1


def _coasts(car: Architecture, command: Decision, look: col.Look) -> bool:
    """Whether a gear is chosen only for the torque converter to be overrun in it: the gear that is in stays."""
    state = State(command.engine_on, command.gears, frozenset(), command.listed)
    return bool(
        runs_free(car, [state], np.array([look.speed_mps]), np.array([command.engine_radps]))[0]
    )


def _undecided(
    car: Architecture, cycle: Cycle, from_s: Array, planned: Trajectory
) -> tuple[list[int], list[int], LoopTask]:
    """The driver's gear at each step of the cycle, the step of each decision, and the task before any of them."""
    table, count = planned.problem.table, len(from_s) - 1
    gears, open_while = driver_gears(signals_of(table))
    step = np.maximum(np.searchsorted(table.time_s, from_s[:-1] + 1e-9, "right") - 1, 0)
    plan = ForwardPlan(
        np.zeros(count, dtype=np.int64), np.zeros(count, dtype=bool), open_while[step], np.zeros(count),
        np.full(count + 1, float(planned.energy_j[0])), np.zeros((count, len(car.machines) - 1)),
    )  # fmt: skip
    return gears.tolist(), step.tolist(), task_of(car, cycle, plan, from_s)
