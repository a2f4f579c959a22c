"""A way at its steps with some torques given: what everything else does, burns and draws."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.car.balance import joints_of
from hevopt.car.driveline import BRAKE, ENGINE
from hevopt.car.machine import Machine
from hevopt.car.ways import Way
from hevopt.display.facts import Shown
from hevopt.powertrain.shafts import Shafts
from hevopt.powertrain.torques import Torques
from hevopt.problem.arrays import Array, Flags, Indices


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Setting(Shown):
    """A way at its states, (state,), before any torque is chosen.

    least_nm: lowest torque that the engine may have: drag where the wheels turn it (fuel cut), else 0, as it keeps
    itself turning; 0 too at speeds beyond a measured map's, where no torque of the engine is used
    """

    car: Architecture
    way: Way
    shafts: Shafts
    torques: Torques
    least_nm: Array

    @property
    def engine_radps(self) -> Array:
        """(state,) speed of the engine, 0 where it does not turn with this way."""
        return self.speed_radps(ENGINE)

    def speed_radps(self, name: str) -> Array:
        """(state,) speed of an actuator; 0 where the way leaves it at rest."""
        shaft = self.way.active.get(name)
        return np.zeros(len(self.shafts.step)) if shaft is None else self.shafts.speed_radps[shaft]

    @property
    def machines(self) -> dict[str, Machine]:
        """The machines that have a torque here, by name."""
        named = zip(self.car.driveline.machines, self.car.machines, strict=True)
        return {name: machine for (name, _), machine in named if name in self.way.active}

    def limit_nm(self, name: str) -> Array:
        """(state,) largest torque of either sign of a machine; 0 beyond its highest speed."""
        machine, speed = self.machines[name], np.abs(self.speed_radps(name))
        return np.where(speed <= machine.speed_max_radps, machine.limit_nm(speed), 0.0)

    def unbraked(self, given: Mapping[str, Array]) -> dict[str, Array]:
        """Given torques, and no friction brake where something else can move the wheels."""
        return {**given, BRAKE: np.zeros((1, 1))} if self.way.slack is not None else dict(given)


def setting(car: Architecture, way: Way, shafts: Shafts) -> Setting:
    """The setting of a way at its states."""
    least = np.zeros(len(shafts.step))
    if ENGINE in way.active and (way.tied or "free" in way.held.values()):
        drag = car.engine.drag_nm(shafts.speed_radps[way.active[ENGINE]])
        least = np.where(np.isnan(drag), 0.0, drag)
    return Setting(car, way, shafts, Torques(way, shafts), least)


def completed(here: Setting, given: Mapping[str, Array]) -> dict[str, Array]:
    """All torques: of engine, machines, friction brake (negative), and of joints that only push.

    (state, level), or (state, 1) or (1, 1) where all levels, or states, have one.

    Without demand at the wheels an engine that closes the balance stops at its lowest torque, and the friction
    brakes take what the shafts do not.
    """
    way, torques = here.way, here.torques
    pushing = [joint.name for joint in joints_of(way) if joint.pushes]
    wanted = [name for name in (*way.active, BRAKE, *pushing) if name not in given]
    if way.slack is None or way.slack in given:
        found = torques.solve(given, wanted)
    else:
        free = here.unbraked(given)
        found = torques.solve(free, [name for name in wanted if name != BRAKE])
        found[BRAKE] = free[BRAKE]
        if way.slack == ENGINE:
            found = _braked(here, given, wanted, found, shape_of(here, given))
    return {**given, **found}


def _braked(
    here: Setting,
    given: Mapping[str, Array],
    wanted: list[str],
    found: Mapping[str, Array],
    shape: tuple[int, ...],
) -> dict[str, Array]:
    """With the engine at its lowest torque where the balance asks for less, and friction brakes for the rest."""
    least = here.least_nm[:, None]
    below = (found[ENGINE] < least) & (here.shafts.wheel_nm <= 0)[:, None]
    below = np.broadcast_to(below, shape)
    state = np.flatnonzero(below.any(axis=1))
    if not len(state):
        return dict(found)
    part = Torques(here.way, here.shafts.picked(state))
    known = {name: _rows(t, state) for name, t in given.items()} | {ENGINE: least[state]}
    at_least = part.solve(known, [name for name in wanted if name != ENGINE])
    result = {name: np.array(np.broadcast_to(t, shape)) for name, t in found.items()}
    for name, torque in (at_least | {ENGINE: least[state]}).items():
        result[name][state] = np.where(below[state], torque, result[name][state])
    return result


def _rows(torque: Array, state: Indices) -> Array:
    return torque if len(torque) == 1 else torque[state]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Flowing(Shown):
    """What torques burn and draw: fuel and NOx flow, and electric power of each machine by name.

    Arrays are (state, level), or (state, 1) or (1, 1) where all levels, or states, have one.
    off_engine_map, off_machine_map: where no data are; the flows are 0 there
    """

    fuel_kgps: Array
    nox_kgps: Array
    electric_w: Mapping[str, Array]
    off_engine_map: Flags
    off_machine_map: Flags

    @property
    def machines_w(self) -> Array:
        """Electric power of all machines together."""
        return sum(self.electric_w.values(), np.zeros((1, 1)))


def flowing(here: Setting, torques: Mapping[str, Array]) -> Flowing:
    """Fuel, NOx and electric power of all torques."""
    fuel = nox = np.zeros((1, 1))
    if ENGINE in here.way.active:
        engine, speed = here.car.engine, here.engine_radps[:, None]
        fuel = engine.fuel_kgps(torques[ENGINE], speed)
        nox = np.where(fuel == 0, 0.0, engine.nox_kgps(torques[ENGINE], speed))
    off_engine = np.isnan(fuel) | np.isnan(nox)
    if off_engine.any():
        fuel, nox = np.nan_to_num(fuel), np.nan_to_num(nox)
    off_machine, electric = np.zeros((1, 1), dtype=bool), {}
    for name, machine in here.machines.items():
        speed = here.speed_radps(name)[:, None]
        loss = machine.loss_w(torques[name], speed)
        unknown = np.isnan(loss)
        if unknown.any():
            loss, off_machine = np.where(unknown, 0.0, loss), off_machine | unknown
        electric[name] = torques[name] * speed + loss
    return Flowing(fuel, nox, electric, off_engine, off_machine)


def shape_of(here: Setting, torques: Mapping[str, Array]) -> tuple[int, ...]:
    """(states, levels) of all torques together."""
    shapes = (torque.shape for torque in torques.values())
    return np.broadcast_shapes(*shapes, (len(here.shafts.step), 1))
