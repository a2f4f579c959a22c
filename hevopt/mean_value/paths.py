"""How engine and machines reach the wheels of a car in a gear, from its driveline: ratio, efficiency, inertia."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hevopt.car.architecture import Architecture
from hevopt.car.driveline import Phase, State
from hevopt.car.parts import WHEEL, Clutch, Joint, TorqueConverter
from hevopt.car.ways import Way, way
from hevopt.errors import DataError

Array = NDArray[np.float64]


class Path(NamedTuple):
    """Speed over that of the wheels, and the share of its power that reaches them."""

    ratio: float
    efficiency: float


class Paths(NamedTuple):
    """engine: its path; machines: the path of each, None where it is not joined
    crank_kgm2, wheel_kgm2: inertia of rotors that turn with the crankshaft whatever the clutch does; of the others
    """

    engine: Path
    machines: tuple[Path | None, ...]
    crank_kgm2: float
    wheel_kgm2: float


def paths(architecture: Architecture, gear: int, speed_mps: float) -> Paths:
    """The paths in a gear with the clutch closed, or a torque converter locked.

    DataError where the car has no such gear, or no engine in gear.

    Where machines have gears of their own, those in which they add most force at the speed.
    """
    driveline = architecture.driveline
    box = next((box for box in driveline.boxes if gear in box.gears and box.choice != "free"), None)
    if driveline.engine is None or box is None:
        gears = sorted({g for box in driveline.boxes if box.choice != "free" for g in box.gears})
        known = f"gears {gears[0]} to {gears[-1]}" if gears else "no gearbox that follows a gear"
        raise DataError(
            f"{architecture.source}: gear {gear} of a tip-in; this car has {known}; choose another gear, or a car "
            "whose engine drives through one"
        )
    phase, best = Phase(False, "closed", box.name), None
    for state in driveline.states():
        kept = [
            other
            for other in driveline.boxes
            if other.choice == "preselected" and gear in other.gears
        ]
        if not state.engine_on or any(state.gear(other.name) != gear for other in kept):
            continue
        found = _paths(architecture, state, phase, gear)
        if found is not None:
            force = sum(_forces_n(architecture, found, speed_mps))
            best = (force, found) if best is None or force > best[0] else best
    if best is None:
        raise DataError(
            f"{architecture.source}: in gear {gear} no gears join engine and wheels; a tip-in needs a car whose "
            "engine drives through a gearbox"
        )
    return best[1]


def _paths(architecture: Architecture, state: State, phase: Phase, gear: int) -> Paths | None:
    driveline = architecture.driveline
    found = way(driveline, state, phase)
    if not found.tied or driveline.engine is None:
        return None
    joints = found.joints(gear)
    if any(joint.lost is not None for joint in joints):
        raise DataError(
            f"{architecture.source}: its gearbox has a loss_map, and a tip-in counts with one efficiency a gear; "
            "give efficiency in its place for a tip-in"
        )
    speed = _speeds(found, joints)
    rigid = _rigid(found, joints, driveline.engine)
    machines: list[Path | None] = []
    crank, wheels = 0.0, 0.0
    for machine, (_, shaft) in zip(architecture.machines, driveline.machines, strict=True):
        if shaft not in found.shafts:
            machines.append(None)
            continue
        machines.append(_path(found, joints, speed, shaft))
        if shaft in rigid:
            crank += machine.inertia_kgm2 * (speed[shaft] / speed[driveline.engine]) ** 2
        else:
            wheels += machine.inertia_kgm2 * speed[shaft] ** 2
    return Paths(_path(found, joints, speed, driveline.engine), tuple(machines), crank, wheels)


def strongest(architecture: Architecture, found: Paths, speed_mps: float) -> int | None:
    """Which machine adds most force at the wheels at a speed; None where none is joined to them."""
    forces = _forces_n(architecture, found, speed_mps)
    return max(range(len(forces)), key=forces.__getitem__) if max(forces, default=0.0) > 0 else None


def _forces_n(architecture: Architecture, found: Paths, speed_mps: float) -> list[float]:
    """The most that each machine adds at the wheels at a speed."""
    radius, forces = architecture.vehicle.tyre_radius_m, []
    for machine, path in zip(architecture.machines, found.machines, strict=True):
        turning = 0.0 if path is None else path.ratio * speed_mps / radius
        if path is None or turning > machine.speed_max_radps:
            forces.append(0.0)
        else:
            limit = float(machine.limit_nm(np.array([turning]))[0])
            forces.append(limit * path.ratio * path.efficiency / radius)
    return forces


def _speeds(found: Way, joints: tuple[Joint, ...]) -> dict[str, float]:
    """Shaft -> speed over that of the wheels."""
    rows = [[float(joint.speed.get(shaft, 0.0)) for shaft in found.shafts] for joint in joints]
    wheel = [float(shaft == WHEEL) for shaft in found.shafts]
    solved = np.linalg.lstsq(np.array([*rows, wheel]), np.array([0.0] * len(rows) + [1.0]))[0]
    return dict(zip(found.shafts, map(float, solved), strict=True))


def _path(found: Way, joints: tuple[Joint, ...], speed: dict[str, float], shaft: str) -> Path:
    """Of a torque of 1 Nm on a shaft, what reaches the wheels with the losses of its way."""
    others = [other for other in found.shafts if other != WHEEL]
    sides = [sum(float(c) * speed[s] for s, c in joint.sense.items()) for joint in joints]
    share = np.ones(len(joints))
    for _ in range(3):
        force = np.linalg.lstsq(
            np.array([_reactions(joints, share, other) for other in others]),
            np.array([-float(other == shaft) for other in others]),
        )[0]
        given = [float(np.asarray(joint.efficiency)) for joint in joints]
        enters = force * sides > 0
        share = np.where(enters, given, 1.0 / np.array(given))
    torque = float(np.dot(_reactions(joints, share, WHEEL), force))
    return Path(speed[shaft], torque / speed[shaft])


def _reactions(joints: tuple[Joint, ...], share: Array, shaft: str) -> list[float]:
    found = []
    for joint, h in zip(joints, share, strict=True):
        c0, c1 = joint.reaction.get(shaft, (0.0, 0.0))
        found.append(float(c0) + float(c1) * float(h))
    return found


def _rigid(found: Way, joints: tuple[Joint, ...], engine: str) -> set[str]:
    """The shafts that turn with the engine whatever the driver's clutch does."""
    fixed = [
        set(joint.reaction)
        for use, joint in zip(found.uses, joints, strict=True)
        if not isinstance(use.part, TorqueConverter)
        and not (isinstance(use.part, Clutch) and use.part.operation == "driver")
    ]
    reached = {engine}
    for _ in fixed:
        for group in fixed:
            if group & reached:
                reached |= group
    return reached
