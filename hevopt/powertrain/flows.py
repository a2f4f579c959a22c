"""Powers, speeds and torques of a powertrain's controls, worked out where they are asked for.

Of every control they would take ten times the memory of all that a strategy reads; a plan has one control per step.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.car.balance import joints_of
from hevopt.car.driveline import BRAKE, ENGINE, State
from hevopt.car.parts import WHEEL
from hevopt.powertrain.branches import Driven, Piece
from hevopt.powertrain.cells import cells_of
from hevopt.powertrain.kinetic import jumps_along, left_out_j
from hevopt.powertrain.operation import Setting, completed, flowing, setting
from hevopt.problem.arrays import Array, Indices
from hevopt.problem.cells import SplitCells, TableFigures
from hevopt.problem.flows import Flows

_NAMES = (
    "engine_torque_nm", "engine_speed_radps", "fuel_power_w", "engine_loss_w", "engine_inertia_w",
    "machine_power_w", "machine_electric_w", "machine_loss_w", "machine_inertia_w",
    "clutch_loss_w", "gearbox_loss_w", "gear_loss_w", "brake_power_w", "wheel_power_w", "auxiliary_power_w",
)  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PowerFlows(Flows):
    """Of the controls of all branches, those of the first branch first."""

    steps: int
    branches: tuple[Driven, ...]
    car: Architecture

    def __getitem__(self, name: str) -> Array:
        if name not in self._names:
            raise KeyError(name)
        flow: Array = self.several((name,))[0]
        return flow

    def several(self, names: Sequence[str]) -> Array:
        """(name, time, control) of some flows, worked out together."""
        columns = sum(len(branch.labels) for branch in self.branches)
        whole, first = np.zeros((len(names), self.steps, columns)), 0
        for branch in self.branches:
            width = len(branch.labels)
            for piece in branch.pieces:
                step, found = piece.here.shafts.step, self._some(piece.here, piece.given, names)
                for n, name in enumerate(names):
                    if piece.slot is None:
                        whole[n, step, first : first + width] = found[name]
                    else:
                        one = np.broadcast_to(found[name], (len(step), 1))
                        whole[n, step, first + piece.slot] = one[:, 0]
            first += width
        return whole

    @property
    def machines(self) -> tuple[str, ...]:
        """Names of the machines."""
        return tuple(name for name, _ in self.car.driveline.machines)

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    @property
    def _names(self) -> tuple[str, ...]:
        own = (f"{name}_{what}" for name in self.machines for what in ("torque_nm", "speed_radps"))
        converter = ("converter_loss_w",) if self.car.converter is not None else ()
        free = ("shafts_left_out_j",) if self.car.driveline.free_engine_speed else ()
        return (*_NAMES, *converter, *free, *own)

    def cells(self, figures: TableFigures, *, nox: bool = True) -> SplitCells | None:
        return cells_of(self.branches, figures, nox=nox)

    def states(self, control: Indices) -> list[State]:
        """The state of the driveline at each step of a plan."""
        return [self.branches[n].state for n in self._owner(control)]

    def _owner(self, control: Indices) -> Indices:
        """(time,) index of the branch of each of some controls."""
        widths = [len(branch.labels) for branch in self.branches]
        owner: Indices = np.searchsorted(np.cumsum(widths), control, "right")
        return owner

    def given(self, control: Indices) -> dict[str, Array]:
        """actuator -> (time,) torque that the plan gives it, NaN where it gives none."""
        found: dict[str, Array] = {}
        for piece, state, level in self._taken(control):
            for name, torque in piece.given.items():
                values = found.setdefault(name, np.full(len(control), np.nan))
                values[piece.here.shafts.step[state]] = torque[state, level]
        return found

    def along(self, control: Indices) -> dict[str, Array]:
        """name -> (time,) of one control per step, with what shafts hold and what their jumps take."""
        found = {name: np.zeros(len(control)) for name in self._names}
        for piece, state, level in self._taken(control):
            here, step = piece.here, piece.here.shafts.step[state]
            some = setting(here.car, here.way, here.shafts.picked(state))
            given = {name: torque[state, level][:, None] for name, torque in piece.given.items()}
            for name, flow in self._of(some, given).items():
                found[name][step] = np.broadcast_to(flow, (len(step), 1))[:, 0]
        on = np.array([branch.state.engine_on for branch in self.branches])
        kinetics = [branch.kinetic for branch in self.branches]
        return found | jumps_along(self.car, kinetics, on, self._owner(control))

    def _taken(self, control: Indices) -> Iterator[tuple[Piece, Indices, Indices]]:
        """The pieces that a plan drives, the states of each that it takes, and the level at each."""
        first = 0
        for branch in self.branches:
            level, width = control - first, len(branch.labels)
            first += width
            for piece in branch.pieces:
                of_piece = level[piece.here.shafts.step]
                if piece.slot is None:
                    state = np.flatnonzero((of_piece >= 0) & (of_piece < width))
                    taken = of_piece[state]
                else:
                    state = np.flatnonzero(of_piece == piece.slot)
                    taken = np.zeros(len(state), dtype=np.int64)
                if len(state):
                    yield piece, state, taken

    def _some(
        self, here: Setting, given: Mapping[str, Array], names: Sequence[str]
    ) -> Mapping[str, Array]:
        """Some flows among those of `_of`; of torques and the engine's speed nothing else is worked out."""
        turns = {f"{actuator}_torque_nm": actuator for actuator in (ENGINE, *self.machines)}
        if not {*names} <= {"engine_speed_radps", *turns}:
            return self._of(here, given)
        wanted = {turns[name] for name in names if name in turns}
        torques = given if wanted <= {*given} else completed(here, given)
        none = np.zeros((1, 1))
        found = {name: torques.get(actuator, none) for name, actuator in turns.items()}
        return found | {"engine_speed_radps": here.engine_radps[:, None]}

    def _of(self, here: Setting, given: Mapping[str, Array]) -> dict[str, Array]:
        """name -> flows of (state, level) torques given, some (state, 1)."""
        torques = completed(here, given)
        known = [*here.way.chosen, *([here.way.slack] if here.way.slack is not None else [])]
        names = [joint.name for joint in joints_of(here.way)]
        joints = here.torques.solve({name: torques[name] for name in known}, names)
        found = _flows(here, torques)
        for loss in ("clutch", "gearbox", "gear"):
            found[f"{loss}_loss_w"] = np.zeros((1, 1))
        if here.shafts.slip is not None:
            found["clutch_loss_w"] = here.shafts.slip.heat_w[:, None]
        for joint in joints_of(here.way):
            entering_w = joints[joint.name] * here.torques.sense_radps(joint)[:, None]
            name = f"{joint.loss}_loss_w"
            if joint.lost is not None:
                found[name] = found[name] + here.torques.lost_w(joint, joints[joint.name])
            elif not joint.speed:
                found[name] = found[name] + entering_w
            elif not joint.lossless:
                eta = here.shafts.at(joint.efficiency)
                eta = eta[:, None] if isinstance(eta, np.ndarray) else eta
                found[name] = found[name] + np.where(
                    entering_w > 0, entering_w * (1 - eta), entering_w * (1 - 1 / eta)
                )
        if self.car.converter is not None:
            bus_w = found["machine_electric_w"] + found["auxiliary_power_w"]
            found["converter_loss_w"] = self.car.converter.loss_w(bus_w)
        if self.car.driveline.free_engine_speed:
            found["shafts_left_out_j"] = left_out_j(self.car, here.way, here.shafts)[:, None]
        for name in self.machines:
            none = np.zeros((1, 1))
            found[f"{name}_torque_nm"] = torques.get(name, none)
            found[f"{name}_speed_radps"] = here.speed_radps(name)[:, None]
        return found


def _flows(here: Setting, torques: Mapping[str, Array]) -> dict[str, Array]:
    """Powers and losses. Joints, machines and brakes lose by laws of their own, so that the balances of driveline
    and car are checks; the engine's loss is what fuel power is not turned into work."""
    shafts, burnt, none = here.shafts, flowing(here, torques), np.zeros((1, 1))
    engine_speed = here.engine_radps[:, None]
    engine_torque = torques.get(ENGINE, none)
    fuel_power = burnt.fuel_kgps * here.car.engine.heating_value_jpkg
    machine_w = none
    for name in here.machines:
        machine_w = machine_w + torques[name] * here.speed_radps(name)[:, None]
    engine_inertia_w, machine_inertia_w = (power[:, None] for power in shafts.inertia_w)
    wheel_speed = shafts.speed_radps[WHEEL][:, None]
    return {
        "engine_torque_nm": engine_torque,
        "engine_speed_radps": engine_speed,
        "fuel_power_w": fuel_power,
        "engine_loss_w": fuel_power - engine_torque * engine_speed,
        "engine_inertia_w": engine_inertia_w,
        "machine_power_w": machine_w,
        "machine_electric_w": burnt.machines_w,
        "machine_loss_w": burnt.machines_w - machine_w,
        "machine_inertia_w": machine_inertia_w,
        "brake_power_w": -torques[BRAKE] * wheel_speed,
        "wheel_power_w": shafts.wheel_nm[:, None] * wheel_speed,
        "auxiliary_power_w": shafts.load_w[:, None],
    }
