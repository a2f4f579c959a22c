"""A way at its steps with some torques given: what everything else does, burns and draws."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.car.balance import joints_of
from hevopt.car.driveline import BRAKE, ENGINE
from hevopt.car.machine import Machine
from hevopt.car.parts import WHEEL
from hevopt.car.ways import Way
from hevopt.display.facts import Shown
from hevopt.powertrain.shafts import Shafts
from hevopt.powertrain.torques import Torques
from hevopt.problem.arrays import Array, Flags, Indices
from hevopt.units import STANDARD_GRAVITY_MPS2


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Setting(Shown):
    """A way at its states, (state,), before any torque is chosen.

    least_nm: lowest torque that the engine may have: drag where the wheels turn it (fuel cut), else 0, as it keeps
    itself turning; 0 too at speeds beyond a measured map's, where no torque of the engine is used
    friction_nm: what the friction brakes take at least where a machine brakes the wheels
    interrupted: actuators whose torque does not reach the wheels while the listed gearbox changes gear
    """

    car: Architecture
    way: Way
    shafts: Shafts
    torques: Torques
    least_nm: Array
    friction_nm: Array
    interrupted: frozenset[str]

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

    def active(self, name: str) -> Array:
        """(state,) share of the step in which an actuator's torque reaches the wheels: less while gears change.

        Torques are means over the step; what reaches the wheels for a share of it only is as much larger then.
        A machine on the engine's shaft turns on with it.
        """
        lasting = self.shafts.gap
        return 1 - lasting if name in self.interrupted else np.ones(len(lasting))

    def limit_nm(self, name: str) -> Array:
        """(state,) largest torque of either sign of a machine; 0 beyond its highest speed."""
        machine, speed = self.machines[name], np.abs(self.speed_radps(name))
        limit = np.where(speed <= machine.speed_max_radps, machine.limit_nm(speed), 0.0)
        return limit * self.active(name)

    def engine_nm(self, of_speed: Callable[[Array], Array]) -> Array:
        """(state,) one of the engine's torques over speed: full load, drag, what its map covers."""
        return of_speed(self.engine_radps) * self.active(ENGINE)

    def idle_nm(self, name: str) -> Array:
        """(state,) torque at which a machine supplies the electric load and no more; 0 where it cannot."""
        machine, speed, share = self.machines[name], self.speed_radps(name), self.active(name)
        between_w = (1 - share) * machine.loss_w(np.zeros(len(speed)), speed)
        load_w = (self.shafts.load_w + between_w) / share
        return np.nan_to_num(share * machine.generating_nm(load_w, speed))

    def least_braked(self, given: Mapping[str, Array]) -> dict[str, Array]:
        """Given torques, and the friction brakes' least where something else can move the wheels."""
        return (
            {**given, BRAKE: -self.friction_nm[:, None]}
            if self.way.slack is not None
            else dict(given)
        )

    def unbraked(self, given: Mapping[str, Array]) -> dict[str, Array]:
        """Given torques, and no friction brake where something else can move the wheels."""
        return {**given, BRAKE: np.zeros((1, 1))} if self.way.slack is not None else dict(given)


def setting(car: Architecture, way: Way, shafts: Shafts) -> Setting:
    """The setting of a way at its states."""
    least = np.zeros(len(shafts.step))
    if ENGINE in way.active and (way.tied or "free" in way.held.values()):
        drag = car.engine.drag_nm(shafts.speed_radps[way.active[ENGINE]])
        least = np.where(np.isnan(drag), 0.0, drag)
    cut = _interrupted(way)
    return Setting(
        car,
        way,
        shafts,
        Torques(way, shafts),
        least * (1 - shafts.gap) if ENGINE in cut else least,
        _friction_nm(car, shafts, shafts.gap if cut.issuperset(way.active) else 0 * shafts.gap),
        frozenset(n for n in cut if n == ENGINE or way.active[n] != way.active.get(ENGINE)),
    )


def _interrupted(way: Way) -> frozenset[str]:
    """The actuators that reach the wheels through a gearbox in its listed gear only."""
    lasting = [set(use.part.shafts) for use in way.uses if use.gear is not None]
    reached = {WHEEL}
    for _ in lasting:
        reached |= {shaft for part in lasting if part & reached for shaft in part}
    return frozenset(name for name, shaft in way.active.items() if shaft not in reached)


def _friction_nm(car: Architecture, shafts: Shafts, gap: Array) -> Array:
    """(state,) torque of the friction brakes that a machine may not take over, nor can while gears change."""
    vehicle, asked = car.vehicle, np.maximum(-shafts.wheel_nm, 0.0)
    if vehicle.braking is None:
        return asked * gap
    rate = asked / (vehicle.tyre_radius_m * vehicle.mass_kg * STANDARD_GRAVITY_MPS2)
    speed = shafts.speed_radps[WHEEL] * vehicle.tyre_radius_m
    return asked * (1 - (1 - gap) * vehicle.braking.share(speed, rate))


def completed(here: Setting, given: Mapping[str, Array]) -> dict[str, Array]:
    """All torques: of engine, machines, friction brake (negative), and of joints that only push or lose by a map.

    (state, level), or (state, 1) or (1, 1) where all levels, or states, have one.

    Without demand at the wheels an engine that closes the balance stops at its lowest torque, and the friction
    brakes take what the shafts do not.
    """
    way, torques = here.way, here.torques
    beside = [joint.name for joint in joints_of(way) if joint.pushes or joint.lost is not None]
    wanted = [name for name in (*way.active, BRAKE, *beside) if name not in given]
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
        share = here.active(ENGINE)[:, None]
        torque = torques[ENGINE] / share
        fuel = engine.fuel_kgps(torque, speed)
        nox = np.where(fuel == 0, 0.0, engine.nox_kgps(torque, speed))
        if (share < 1).any():
            # While gears change it turns on without load.
            none = np.zeros(share.shape)
            fuel = share * fuel + (1 - share) * engine.fuel_kgps(none, speed)
            nox = share * nox + (1 - share) * engine.nox_kgps(none, speed)
    off_engine = np.isnan(fuel) | np.isnan(nox)
    if off_engine.any():
        fuel, nox = np.nan_to_num(fuel), np.nan_to_num(nox)
    off_machine, electric = np.zeros((1, 1), dtype=bool), {}
    for name, machine in here.machines.items():
        speed, share = here.speed_radps(name)[:, None], here.active(name)[:, None]
        loss = machine.loss_w(torques[name] / share, speed)
        if (share < 1).any():
            loss = share * loss + (1 - share) * machine.loss_w(np.zeros_like(speed), speed)
        unknown = np.isnan(loss)
        if unknown.any():
            loss, off_machine = np.where(unknown, 0.0, loss), off_machine | unknown
        electric[name] = torques[name] * speed + loss
    return Flowing(fuel, nox, electric, off_engine, off_machine)


def shape_of(here: Setting, torques: Mapping[str, Array]) -> tuple[int, ...]:
    """(states, levels) of all torques together."""
    shapes = (torque.shape for torque in torques.values())
    return np.broadcast_shapes(*shapes, (len(here.shafts.step), 1))
