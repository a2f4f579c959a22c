"""A car in steps, under commands from outside: what a controller, another simulator or an FMU puts at its pedals.

It is the loop of `follow`, its driver's force and its plan's step given from outside: gears, clutch, sharing of
torques and books are those of a driven trace, to the last bit where the commands are.
"""

from typing import Any, NamedTuple

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.car.handling import Handling
from hevopt.car.parts import Clutch
from hevopt.errors import DataError
from hevopt.forward import _drive_kernels as col
from hevopt.forward import _motor_kernels as motor
from hevopt.forward._acting_kernels import LoopTask
from hevopt.forward._pedal_kernels import PedalState
from hevopt.forward.books import Books, books_of
from hevopt.forward.known import check_known
from hevopt.forward.lines import line_of
from hevopt.forward.loads import own_loads_w
from hevopt.forward.loops import Driving, empty_course
from hevopt.forward.run import (
    STEP_S,
    check_step,
    loop_car,
    starts_of,
    whole_handling,
)
from hevopt.problem.arrays import Array
from hevopt.problem.battery import energy_j, soc

# A speed wanted, at which the loop's driver does not hold the car.
_MOVES_MPS = 1.0
_FASTEST_MPS = 100.0
# The loop's driver passes on what stands in his integral, and nothing of his own.
_NO_GAINS = {
    "proportional": 0.0, "integral": 0.0, "derivative": 0.0, "feed_forward": 0.0, "preview_s": 0.0,
    "charge_per_s": 0.0,
}  # fmt: skip


class Commands(NamedTuple):
    """What is asked of a car over some steps.

    force_n: at the driven tyres, braking below 0; hold: brakes keep the car where it stands, and the clutch is open
    gear: the listed one; gears: (name of the box, gear) chosen beside it, as in the keys of a Line; () for any
    engine_on: as wanted; clutch_open: the driver's, or neutral of a gearbox behind a torque converter
    machines_nm: (name, torque) of machines that are asked for one, see `CommandedCar.asked_machines`; 0 of others
    lock_up_open: of a torque converter; grade: of the road, rise over run
    engine_radps, engine_nm, clutch_closed: of an engine that has a speed of its own, and of what joins it to the
    wheels
    """

    force_n: float = 0.0
    hold: bool = False
    gear: int = 1
    gears: tuple[tuple[str, int], ...] = ()
    engine_on: bool = True
    clutch_open: bool = False
    machines_nm: tuple[tuple[str, float], ...] = ()
    grade: float = 0.0
    lock_up_open: bool = False
    engine_radps: float = 0.0
    engine_nm: float = 0.0
    clutch_closed: bool = False


class Standing(NamedTuple):
    """All that a commanded car is between two steps.

    loop, row: a Loop or FreeLoop, and what its last step recorded; None before the first
    """

    loop: Any
    row: Array | None
    steps: int
    stored_j: float
    distance_m: float
    fuel_kg: float
    nox_kg: float


class CommandedSteps(NamedTuple):
    """What some steps have done; record: (step, column) of _drive_kernels; books: of the same steps."""

    record: Array
    books: Books
    gear: int
    engine: int
    full: bool


class CommandedCar:
    """A car under commands, of which `standing` may be kept and put back.

    car: DataError where it cannot be driven forward; step_s: 0.001 to 0.1 s
    soc_start: of its battery, the car's own where None is given; speed_mps: with which it begins
    """

    def __init__(
        self,
        car: Architecture,
        *,
        step_s: float = STEP_S,
        handling: Handling | None = None,
        soc_start: float | None = None,
        speed_mps: float = 0.0,
    ) -> None:
        self.car, self.step_s = car, float(step_s)
        whole = whole_handling(car, handling)
        check_step(step_s, whole)
        self.line = line_of(car)
        self._slips, self._speed_mps = whole.tyre.slips, float(speed_mps)
        charge = car.soc_start if soc_start is None else float(soc_start)
        low, high = car.battery.soc_min, car.battery.soc_max
        if not low <= charge <= high:  # nor NaN
            raise DataError(f"soc_start {charge:g}; allowed for {car.name}: {low:g} to {high:g}")
        if not 0.0 <= self._speed_mps <= _FASTEST_MPS:
            raise DataError(f"start speed {speed_mps:g} m/s; allowed: 0 to {_FASTEST_MPS:g} m/s")
        driver = whole.driver._replace(**_NO_GAINS)
        self._task = _empty_task(car)
        self._course = empty_course(self.line, 1, len(car.machines))
        driven = loop_car(car, self.line, whole._replace(driver=driver), self._task.load_w)
        self._driving = Driving(car, self.line, self._speed_mps, driven, self._task, self._course)
        stored = float(energy_j(car.battery, charge))
        self.standing = Standing(None, None, 0, stored, 0.0, 0.0, 0.0)

    @property
    def speed_mps(self) -> float:
        """Speed of the car."""
        loop = self.standing.loop
        return self._speed_mps if loop is None else float(loop.state.speed_mps)

    @property
    def side_radps(self) -> float:
        """Speed of the engine; 0 before the first step."""
        loop = self.standing.loop
        return 0.0 if loop is None else float(loop.state.side_radps)

    @property
    def soc(self) -> float:
        """State of charge."""
        return float(soc(self.car.battery, self.standing.stored_j))

    @property
    def asked_machines(self) -> tuple[str, ...]:
        """Machines that commands may ask for a torque; of the others it follows from all else."""
        line, names = self.line, [name for name, _ in self.car.driveline.machines]
        free = line.free
        if free is not None:
            fixed = {free.driving} if self.has_lock_up else set(free)
        else:
            first_is_asked = not (self.car.electric or self.car.driveline.follows_load)
            fixed = set() if first_is_asked else {line.order[0]}
        return tuple(name for n, name in enumerate(names) if n not in fixed)

    @property
    def has_lock_up(self) -> bool:
        """Whether a clutch joins an engine that has a speed of its own to the wheels."""
        return self.line.free is not None and any(
            isinstance(part, Clutch) for part in self.car.driveline.parts
        )

    def advance(self, commands: Commands, steps: int = 1) -> CommandedSteps:
        """The car after some steps under the same commands.

        DataError for a command that is none, where the battery is empty or cannot give what is asked, and where a
        measured map ends: the car is then as it was before.
        """
        before, loop = self.standing, self.standing.loop
        self._check(commands)
        self._fill(commands)
        if loop is None:
            self._task.speed_mps[:] = self._speed_mps
            loop = self._driving.begun(before.stored_j)
            self._fill(commands)
        start = float(loop.state.speed_mps), float(loop.state.side_radps), before.stored_j
        asked = PedalState(float(commands.force_n), 0.0, 0.0, 0.0, False)
        loop = loop._replace(pedal=asked, ahead_mps=float(self._task.speed_mps[0]))
        record = np.zeros((steps, col.COLUMNS + len(self.car.machines) - 1))
        loop = self._driving.advance(loop, 0, record, self.step_s)
        books, starts = self._books(before, record, start)
        flows = books.flows
        fuel = float(np.sum(flows["fuel_kgps"])) * self.step_s
        self.standing = Standing(
            loop, record[-1], before.steps + steps, float(books.energy_j[-1]),
            before.distance_m + float(np.sum(flows["speed_mps"])) * self.step_s,
            before.fuel_kg + fuel + starts * self.car.engine.start_fuel_kg,
            before.nox_kg + float(np.sum(flows["nox_kgps"])) * self.step_s,
        )  # fmt: skip
        gear = int(self.line.gears[int(record[-1, col.WAY])])
        return CommandedSteps(
            record, books, gear, int(record[-1, col.PHASE]), bool(record[:, col.FULL].any())
        )

    def _check(self, commands: Commands) -> None:
        """DataError for numbers that are none, and for what this car has not."""
        numbers = {
            name: getattr(commands, name)
            for name in ("force_n", "grade", "engine_radps", "engine_nm")
        }
        for name, value in (*numbers.items(), *commands.machines_nm):
            if not np.isfinite(value):
                raise DataError(f"{name} {value}; allowed: finite numbers")
        for name, _ in commands.machines_nm:
            if name not in self.asked_machines:
                allowed = ", ".join(self.asked_machines) or "none"
                raise DataError(
                    f"{name} is asked for a torque; of {self.car.name} these may be: {allowed}"
                )
        free, converter = self.line.free is not None, self.car.driveline.converter is not None
        for name, has in (
            ("clutch_open", not free and not self.car.electric), ("lock_up_open", converter),
            ("clutch_closed", self.has_lock_up), ("engine_radps", free), ("engine_nm", free),
        ):  # fmt: skip
            if getattr(commands, name) and not has:
                raise DataError(
                    f"{name} {getattr(commands, name)}; {self.car.name} has no such thing"
                )

    def _fill(self, commands: Commands) -> None:
        """The one step of the task, which holds for ever."""
        task, course, way = self._task, self._course, self._way(commands)
        asked = dict(commands.machines_nm)
        torques = [asked.get(name, 0.0) for name, _ in self.car.driveline.machines]
        task.speed_mps[:] = 0.0 if commands.hold else _MOVES_MPS
        task.slope_rad[0] = np.arctan(float(commands.grade))
        task.way[0], task.engine_on[0] = way, commands.engine_on and not self.car.electric
        task.apart[0] = 2 if commands.clutch_open else 3 if commands.lock_up_open else 0
        task.machine_nm[0], *task.others_nm[0] = (torques[n] for n in self.line.order)
        if course is not None:
            course.engine_radps[0] = min(commands.engine_radps, self.car.engine.speed_max_radps)
            course.engine_nm[0] = commands.engine_nm
            course.machine_nm[0], course.closed[0] = torques, commands.clutch_closed

    def _way(self, commands: Commands) -> int:
        known = self.line.gears
        if commands.gear not in known:
            raise DataError(
                f"gear {commands.gear}; allowed: {min(known)} to {max(known)}, as {self.car.name} has"
            )
        beside = [chosen for gear, chosen, _ in self.line.keys if gear == commands.gear]
        gears = commands.gears or beside[0]
        if not any(chosen == gears for _, chosen, _ in self.line.keys):
            asked = ", ".join(f"{name} {gear}" for name, gear in gears)
            raise DataError(
                f"gears chosen beside the listed one: {asked}; {self.car.name} has none such"
            )
        return self.line.index(commands.gear, gears)

    def _books(
        self, before: Standing, record: Array, start: tuple[float, float, float]
    ) -> tuple[Books, int]:
        """The books of the steps, and how often the engine was started."""
        books = books_of(self.car, self.line, record, start, self.step_s, self._task.load_w, before=before.row,
                         slips=self._slips)  # fmt: skip
        times: Array = self.step_s * np.arange(before.steps, before.steps + len(record) + 1.0)
        check_known(self.car, books, record, times)
        was = motor.REST if before.row is None else int(before.row[col.PHASE])
        return books, starts_of(books.recorded.engine, was)


def _empty_task(car: Architecture) -> LoopTask:
    """One step of a plan that holds for ever, on a trace that is as long, to be filled."""
    ever, loads_w = np.array([0.0, 1e9]), own_loads_w(car)
    return LoopTask(
        ever, np.zeros(2), np.zeros(1), loads_w, ever, np.zeros(1, dtype=np.int64), np.zeros(1, dtype=bool),
        np.zeros(1, dtype=np.int64), np.zeros(1), np.zeros(2), np.zeros((1, len(car.machines) - 1)),
    )  # fmt: skip
