"""The laws of a car over a range of its final drive: at every step nowhere above those of any final drive between.

Gear ratios are not convex: unlike a size they are branched over, and each piece of their range has laws of its
own. Speeds of what turns with the wheels rise with the ratio f, w = f w', and the power that passes the gearbox
does not depend on it. So torques are told at the highest speed w1 of the piece, T w / w1, where what the wheels
ask for is the same for every f. Of what remains each term takes its least:

    inertia     torque x speed rises or falls with f²: at one end
    machine     c0 + c1 w + c2 w² at an end or where it is least; c3 u² at w1, where the torque is least
    engine      with p = p_mf w / w1 its law is e p - |a2| p² w1 / w = p_me w / w1 - l w / w1: the highest e, the
                least |a2| w1 / w, and friction at the lowest speed
    limits      the greatest power between the ends, for the engine with all points of its full load between
    slipping    the engine holds its speed and pushes: its torque T is at least T w / w1
    switching   energies are constant or rise with f², what a jump takes rises with the jump: at one end

Where the driver's clutch is closed with one end and slips or is open with the other, the step has a mode of either
kind, each as if it held for the whole piece, and the cheaper one counts; jumps from or to such a step are the
least between what both can hold. What this gives away is of first order in the piece's width, about 0.3 % of the
fuel of C2 for 1 %.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from math import pi

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.car.engine_laws import CompactLaw
from hevopt.car.machine_laws import LossByCoefficients
from hevopt.display.facts import Shown
from hevopt.driving.demand import Demand
from hevopt.driving.driver import launches_at_idle
from hevopt.powertrain.kinetic import Jumps, Kinetic, kinetic_of
from hevopt.powertrain.operation import Setting, setting
from hevopt.powertrain.phases import Driver, stretches
from hevopt.problem.arrays import Array, Flags
from hevopt.sizing.proof.modes import Mode, NotProvable, pressures

_SAME = 1e-9
_LEAST = ("driving", "inertia", "inertia_e", "least")


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Pattern(Shown):
    """What the driver's clutch does with one end of a range, held for the whole of it.

    found: engine on, at rest -> settings at each end; kinetic: the same of the shafts' energies
    """

    found: dict[bool, list[list[Setting]]]
    kinetic: dict[bool, list[Kinetic]]

    def settings(self, end: int, *, on: bool) -> list[Setting]:
        """The settings of a state at an end."""
        return self.found[on][end]


def check_launches(ends: Sequence[Architecture], demand: Demand) -> None:
    """NotProvable where the engine launches above idle speed with some final drive of a range."""
    slow, fast = (end.gearbox for end in (ends[0], ends[-1]))
    assert slow is not None and fast is not None  # as check_car has made sure
    late = ~launches_at_idle(demand, ends[0].engine, slow, fast)
    if late.any():
        raise NotProvable(
            f"no proof over ranges of the final drive: at {demand.time_s[int(np.argmax(late))]:g} s the engine "
            "launches above idle speed; narrow the ranges"
        )


def patterns_of(
    ends: Sequence[Architecture], drivers: Sequence[Driver]
) -> tuple[list[Pattern], Flags]:
    """The patterns of all ends, one where they are alike, and (time,) where they are not."""
    first, last = drivers[0], drivers[-1]
    apart = np.zeros(len(first.demand.gear), dtype=bool)
    for (_, here), (_, there) in zip(first.phases[True], last.phases[True], strict=True):
        apart |= here != there
    alike = [first] if not apart.any() else [first, last]
    return [_pattern(ends, drivers, of) for of in alike], apart


def _pattern(ends: Sequence[Architecture], drivers: Sequence[Driver], of: Driver) -> Pattern:
    found: dict[bool, list[list[Setting]]] = {True: [], False: []}
    kinetic: dict[bool, list[Kinetic]] = {True: [], False: []}
    for car, driver in zip(ends, drivers, strict=True):
        states = list(car.driveline.states())
        if [state.engine_on for state in states] != [True, False]:
            raise NotProvable(
                "no proof over ranges: engine on and engine at rest must be the only states"
            )
        for state in states:
            held = stretches(car, replace(driver, phases=of.phases), state)
            on = state.engine_on
            found[on].append([setting(car, each.way, each.shafts) for each in held])
            kinetic[on].append(kinetic_of(car, held, driver.demand.step_s))
    return Pattern(found, kinetic)


def between(car: Architecture, first: Mode, last: Mode) -> Mode:
    """A mode nowhere above those of the final drives between two, torques at the speeds of the higher one."""
    law, loss = car.engine.law, car.machines[0].loss
    assert isinstance(law, CompactLaw) and isinstance(loss, LossByCoefficients)
    slips = last.joined & (np.abs(last.w - last.we) > _SAME * last.we)
    steady = (first.we == last.we) & (last.least == 0) & (last.inertia_e == 0)
    if law.fuel.l > 0 or law.fuel.l2 > 0 or (slips & ~steady).any():
        raise NotProvable(
            f"{car.name}: no proof over ranges of the final drive, its engine's friction falls with speed, or it "
            "turns at a speed of its own"
        )
    slower = np.where(last.w > 0, first.w / np.where(last.w > 0, last.w, 1.0), 1.0)
    mode = Mode(*(getattr(last, field.name).copy() for field in fields(Mode)))
    mode.possible = first.possible | last.possible
    for name in _LEAST:
        setattr(mode, name, np.minimum(slower * getattr(first, name), getattr(last, name)))
    mode.braking = np.maximum(slower * first.braking, last.braking)
    mode.most = np.maximum(slower * first.most, last.most)
    mode.static = np.minimum(first.static, last.static)
    if loss.c2 > 0:
        still = -loss.c1 / (2 * loss.c2)
        inside = (first.w < still) & (still < last.w)
        mode.static = np.where(inside, loss.c0 - loss.c1**2 / (4 * loss.c2), mode.static)
    mode.full = _most_full(car, first, last)
    slower_e = np.where(last.we > 0, first.we / np.where(last.we > 0, last.we, 1.0), 1.0)
    mode.slope = np.maximum(first.slope, last.slope)
    if law.fuel.c < 0:
        peak = -law.fuel.b / (2 * law.fuel.c) * pi / law.stroke_m
        inside = (first.we < peak) & (peak < last.we)
        mode.slope = np.where(inside, pressures(law, np.full_like(last.we, peak))[0], mode.slope)
    mode.friction = np.maximum(slower_e * first.friction, last.friction)
    return mode


def _most_full(car: Architecture, first: Mode, last: Mode) -> Array:
    """(time,) highest torque of full load between two speeds, at the greater of which it would be no less power."""
    engine, share = car.engine, last.share_e
    most = np.maximum(first.full, last.full)
    for speed, torque in zip(engine.full_load_speed_radps, engine.full_load_torque_nm, strict=True):
        inside = (first.we < speed) & (speed < last.we)
        most = np.where(inside, np.maximum(most, torque * share), most)
    return most


def switching_of(
    car: Architecture, patterns: Sequence[Pattern], apart: Flags
) -> tuple[Array, Array]:
    """What switching takes at least per factor: of the engine by its inertia and starts, of the machine its own.

    (2, time, mode, mode) kg and J, engine on first
    """
    before = np.concatenate([[False], apart[:-1]])
    ends = range(len(patterns[0].kinetic[True]))
    steps = len(apart)
    kg, joule = np.zeros((2, steps, 2, 2)), np.zeros((2, steps, 2, 2))
    for i, was in enumerate((True, False)):
        for j, now in enumerate((True, False)):
            for size in range(2):
                each = [
                    _taken(
                        car, [pattern.kinetic for pattern in patterns[:1]], [end], was, now, size
                    )
                    for end in ends
                ]
                least = np.min(each, axis=0)
                if len(patterns) > 1:
                    loose = _taken(car, [p.kinetic for p in patterns], ends, was, now, size)
                    least = np.where(apart | before, loose, least)
                kg[size, :, i, j], joule[size, :, i, j] = least
            if now and not was:
                kg[0, :, i, j] += car.engine.start_fuel_kg
    return kg, joule


def _taken(
    car: Architecture,
    kinetics: Sequence[dict[bool, list[Kinetic]]],
    ends: Sequence[int],
    was: bool,
    now: bool,
    size: int,
) -> tuple[Array, Array]:
    """(time,) fuel and energy that jumps take at least: from the most that the shafts may hold to the least."""

    def hull(on: bool) -> tuple[Kinetic, Kinetic]:
        held = [kinetic[on][end] for kinetic in kinetics for end in ends]
        return tuple(
            Kinetic(
                pick([one.engine_j for one in held], axis=0) * (size == 0),
                pick([one.machines_j for one in held], axis=0) * (size == 1),
            )
            for pick in (np.max, np.min)
        )  # type: ignore[return-value]

    taken = Jumps(car).taken(hull(was)[0], hull(now)[1], hull(True)[0], runs=was and now)
    return taken.fuel_kg, taken.energy_j
