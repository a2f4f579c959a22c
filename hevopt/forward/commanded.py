"""A car in steps, under commands from outside: what a controller, another simulator or an FMU puts at its pedals.

It is the loop of `follow`, its driver's force and its plan's step given from outside: gears, clutch, sharing of
torques and books are those of a driven trace, to the last bit where the commands are.
"""

from typing import NamedTuple

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.car.handling import Handling
from hevopt.errors import DataError
from hevopt.forward import _drive_kernels as col
from hevopt.forward import _motor_kernels as motor
from hevopt.forward._acting_kernels import LoopTask
from hevopt.forward._drive_kernels import Loop
from hevopt.forward._pedal_kernels import PedalState
from hevopt.forward.books import Books, books_of
from hevopt.forward.drivable import check_geared
from hevopt.forward.lines import line_of
from hevopt.forward.run import (
    STEP_S,
    check_charge,
    check_step,
    loop_car,
    own_loads_w,
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
    engine_on, clutch_open: as wanted; machine_nm: of the machine while the engine drives through the clutch
    grade: of the road, rise over run
    """

    force_n: float = 0.0
    hold: bool = False
    gear: int = 1
    gears: tuple[tuple[str, int], ...] = ()
    engine_on: bool = True
    clutch_open: bool = False
    machine_nm: float = 0.0
    grade: float = 0.0


class Standing(NamedTuple):
    """All that a commanded car is between two steps.

    loop, row: of the loop, and what its last step recorded; None before the first
    """

    loop: Loop | None
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
        check_geared(car, "a unit under commands")
        self.line = line_of(car)
        if len(car.machines) > 1:
            raise DataError(
                f"{car.name}: commands are for a car of one machine, and this one has {len(car.machines)}; "
                "`hevopt drive` drives it along a cycle"
            )
        driver = whole.driver._replace(**_NO_GAINS)
        self._driven = loop_car(car, self.line, whole._replace(driver=driver))
        self._slips = whole.tyre.slips
        self._work = col.work_of(self._driven.ways)
        self._loads_w = own_loads_w(car)
        self._speed_mps = float(speed_mps)
        charge = car.soc_start if soc_start is None else float(soc_start)
        low, high = car.battery.soc_min, car.battery.soc_max
        if not low <= charge <= high:  # nor NaN
            raise DataError(f"soc_start {charge:g}; allowed for {car.name}: {low:g} to {high:g}")
        if not 0.0 <= self._speed_mps <= _FASTEST_MPS:
            raise DataError(f"start speed {speed_mps:g} m/s; allowed: 0 to {_FASTEST_MPS:g} m/s")
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

    def advance(self, commands: Commands, steps: int = 1) -> CommandedSteps:
        """The car after some steps under the same commands; DataError for a command that is none, and where the
        battery is empty: the car is then as it was before."""
        before, task = self.standing, self._task(commands)
        loop = before.loop
        if loop is None:
            at_start = task._replace(speed_mps=np.full(2, self._speed_mps))
            loop = col.begun(self._driven, at_start, before.stored_j)
        start = float(loop.state.speed_mps), float(loop.state.side_radps), before.stored_j
        asked = PedalState(float(commands.force_n), 0.0, 0.0, 0.0, False)
        loop = loop._replace(pedal=asked, ahead_mps=float(task.speed_mps[0]))
        record = np.zeros((steps, col.COLUMNS))
        loop = col.advance(self._driven, task, self._work, loop, 0, record, self.step_s)
        books, starts = self._books(before, record, start)
        flows = books.flows
        fuel = float(np.nansum(flows["fuel_kgps"])) * self.step_s
        self.standing = Standing(
            loop, record[-1], before.steps + steps, float(books.energy_j[-1]),
            before.distance_m + float(np.sum(flows["speed_mps"])) * self.step_s,
            before.fuel_kg + fuel + starts * self.car.engine.start_fuel_kg,
            before.nox_kg + float(np.nansum(flows["nox_kgps"])) * self.step_s,
        )  # fmt: skip
        gear = int(self.line.gears[int(record[-1, col.WAY])])
        return CommandedSteps(
            record, books, gear, int(record[-1, col.PHASE]), bool(record[:, col.FULL].any())
        )

    def _task(self, commands: Commands) -> LoopTask:
        """One step of a plan that holds for ever."""
        for name in ("force_n", "machine_nm", "grade"):
            if not np.isfinite(value := getattr(commands, name)):
                raise DataError(f"{name} {value}; allowed: finite numbers")
        way = self._way(commands)
        wanted = 0.0 if commands.hold else _MOVES_MPS
        on = commands.engine_on and not self.car.electric
        ever = np.array([0.0, 1e9])
        return LoopTask(
            ever, np.full(2, wanted), np.arctan(np.array([float(commands.grade)])), self._loads_w, ever,
            np.array([way], dtype=np.int64), np.array([on]),
            np.array([2 if commands.clutch_open else 0], dtype=np.int64),
            np.array([float(commands.machine_nm)]), np.zeros(2), np.zeros((1, 0)),
        )  # fmt: skip

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
        phase = record[:, col.PHASE].astype(np.int64)
        load_w = self._loads_w[np.where(phase == motor.REST, 0, 1), 0]
        books = books_of(self.car, self.line, record, start, self.step_s, load_w, before=before.row,
                         slips=self._slips)  # fmt: skip
        if np.isfinite(before.stored_j):  # else a measured map has ended on the way
            times: Array = self.step_s * np.arange(before.steps, before.steps + len(record) + 1.0)
            check_charge(self.car, books, record, times)
        was = motor.REST if before.row is None else int(before.row[col.PHASE])
        return books, starts_of(phase, was)
