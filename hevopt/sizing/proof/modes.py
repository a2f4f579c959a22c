"""What the driveline does in a mode at every step, and how torques follow from the sizes there.

With u the torque of the machine, in either mode

    joined     T = max(A - u, engine drag),  A = g(y0 + y1 m) + machine Jm + engine Je    the engine closes the
    balance apart      u >= A without Je, the engine at idle or at rest P = u w + machine S + c3 u² / (machine
    share) + aux

where g, the gearbox, has one slope where the wheels are driven and one where they brake. Braking, the friction
brakes leave to the machine no more than two lines in m.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.car.driveline import ENGINE
from hevopt.car.engine_laws import CompactLaw
from hevopt.car.machine_laws import LossByCoefficients
from hevopt.display.facts import Shown
from hevopt.driving.demand import Demand
from hevopt.errors import DataError
from hevopt.powertrain.operation import Setting
from hevopt.problem.arrays import Array, Flags, Indices
from hevopt.units import STANDARD_GRAVITY_MPS2

# A share of the braking that limits nothing.
_ALL = 1e9


class NotProvable(DataError):
    """A car or a range for which there is no such proof; the message says why."""


@dataclass(slots=True, eq=False, repr=False)
class Mode(Shown):
    """One mode at every step, arrays (time,) of the car of factors 1.

    possible: whether the driveline allows it; joined: engine and machine close one balance; turns: the machine acts
    idles: whether the engine turns apart, without torque
    w, we: speeds of machine and engine; share, share_e: of the step in which each reaches the wheels
    driving, braking: slopes of g; y0, y1: wheel torque over mass; low0, low1: (2, time) the same of the most that
    the machine may take of the braking, as two lines, the greater of which holds
    inertia, inertia_e: torques of the inertias of machine and engine; most, full, least: limits of the two
    load: electric load; static, c3: loss of the machine that no torque changes, and per square of its torque
    slope, friction: of the engine's fuel mean pressure, see entries.Fuel
    """

    possible: Flags
    joined: Flags
    turns: Flags
    idles: Flags
    w: Array
    we: Array
    share: Array
    share_e: Array
    driving: Array
    braking: Array
    y0: Array
    y1: Array
    low0: Array
    low1: Array
    inertia: Array
    inertia_e: Array
    most: Array
    full: Array
    least: Array
    load: Array
    static: Array
    c3: Array
    slope: Array
    friction: Array


def mode_of(
    car: Architecture,
    demand: Demand,
    settings: Sequence[Setting],
    gap: Array,
    wheel: Sequence[Array],
    kgs: Sequence[float],
) -> Mode:
    """A state's mode by its ways at their steps.

    wheel: (time,) torque of the wheels at the masses kgs, least and most of the box
    """
    steps = len(demand.step_s)
    flags, arrays = np.zeros((4, steps), dtype=bool), np.zeros((18, steps))
    mode = Mode(*flags, *arrays[:8], *np.full((2, 2, steps), -np.inf), *arrays[8:])
    mode.share[:] = mode.share_e[:] = mode.slope[:] = 1.0
    span = (kgs[1] - kgs[0]) or 1.0
    mode.y1 = (wheel[1] - wheel[0]) / span if kgs[1] > kgs[0] else np.zeros(steps)
    mode.y0 = wheel[0] - mode.y1 * kgs[0]
    for here in settings:
        _fill(car, demand, mode, here, gap, wheel, kgs)
    return mode


def _fill(
    car: Architecture,
    demand: Demand,
    mode: Mode,
    here: Setting,
    gap: Array,
    wheel: Sequence[Array],
    kgs: Sequence[float],
) -> None:
    """One way at its steps."""
    k, way, gearbox = here.shafts.step, here.way, car.gearbox
    assert gearbox is not None  # as check_car has made sure
    turns = "machine" in way.active
    runs = ENGINE in way.active
    joined = turns and runs and "machine" in way.chosen
    geared = way.slack is not None
    ratio, efficiency = gearbox.ratios[demand.gear[k]], gearbox.efficiency[demand.gear[k]]
    mode.turns[k], mode.joined[k], mode.idles[k] = turns, joined, runs and not joined
    mode.driving[k] = 1 / (ratio * efficiency) if geared else 0.0
    mode.braking[k] = efficiency / ratio if geared else 0.0
    lasting = gap[k] if any(use.gear is None for use in way.uses) else np.zeros(len(k))
    cut = here.interrupted
    possible = np.ones(len(k), dtype=bool)
    mode.load[k] = here.shafts.load_w
    if turns:
        machine, loss = car.machines[0], car.machines[0].loss
        assert isinstance(loss, LossByCoefficients)  # as check_car has made sure
        mode.w[k] = here.speed_radps("machine")
        mode.share[k] = 1 - lasting if "machine" in cut else 1.0
        mode.inertia[k] = machine.inertia_kgm2 * here.shafts.accel_radps2[way.active["machine"]]
        mode.most[k] = machine.limit_nm(np.abs(mode.w[k])) * mode.share[k]
        mode.static[k] = np.where(
            mode.w[k] > 0, loss.c0 + loss.c1 * mode.w[k] + loss.c2 * mode.w[k] ** 2, 0.0
        )
        mode.c3[k] = loss.c3
        possible &= mode.w[k] <= machine.speed_max_radps
    if runs:
        possible &= _fill_engine(car, mode, here, lasting)
    if not geared:
        possible &= (wheel[0][k] <= 0) | (wheel[1][k] <= 0) | (demand.wheel_speed_radps[k] == 0)
    mode.possible[k] = possible
    _brakes(
        car, demand, mode, k, lasting if cut.issuperset(way.active) else 0 * lasting, wheel, kgs
    )


def _fill_engine(car: Architecture, mode: Mode, here: Setting, lasting: Array) -> Flags:
    """The turning engine of one way at its steps; (state,) whether it is possible there."""
    k, way, engine, law = here.shafts.step, here.way, car.engine, car.engine.law
    assert isinstance(law, CompactLaw)  # as check_car has made sure
    mode.we[k] = here.engine_radps
    mode.slope[k], mode.friction[k] = pressures(law, mode.we[k])
    mode.share_e[k] = 1 - lasting if ENGINE in here.interrupted else 1.0
    mode.inertia_e[k] = engine.inertia_kgm2 * here.shafts.accel_radps2[way.active[ENGINE]]
    mode.full[k] = engine.full_load_nm(mode.we[k]) * mode.share_e[k]
    mode.least[k] = np.where(way.tied, engine.drag_nm(mode.we[k]), 0.0) * mode.share_e[k]
    slow = way.tied & (mode.we[k] < engine.idle_radps * (1 - 1e-12))
    fits: Flags = ~slow & (mode.we[k] <= engine.speed_max_radps * (1 + 1e-12))
    return fits


def pressures(law: CompactLaw, speed_radps: Array) -> tuple[Array, Array]:
    """Slope e and friction l of p_me = e p_mf + a2 p_mf² + l at some speeds."""
    k, cm = law.fuel, law.piston_speed_mps(speed_radps)
    return k.a + k.b * cm + k.c * cm**2, k.l + k.l2 * cm**2


def _brakes(
    car: Architecture,
    demand: Demand,
    mode: Mode,
    k: Indices,
    lasting: Array,
    wheel: Sequence[Array],
    kgs: Sequence[float],
) -> None:
    """Two lines in the mass whose greater is the lowest wheel torque that the machine may meet.

    asked share(v) is affine in the mass. Where stability limits it, asked x share is m g r most(z) load(z) with z
    affine in 1/m, an affine function and c/m with c >= 0: convex, and so nowhere above its chord. That is so of
    a front axle.
    """
    braking = car.vehicle.braking
    lows = [np.minimum(of[k], 0.0) for of in wheel]
    if braking is None:
        taken = [[low * (1 - lasting) for low in lows]] * 2
    else:
        speed = demand.wheel_speed_radps[k] * car.vehicle.tyre_radius_m
        share = np.interp(speed, braking.speed_mps, braking.machine_share)
        stable = []
        for low, kg in zip(lows, kgs, strict=True):
            rate = -low / (car.vehicle.tyre_radius_m * kg * STANDARD_GRAVITY_MPS2)
            whole = replace(braking, machine_share=np.full_like(braking.machine_share, _ALL))
            stable.append(low * (1 - lasting) * whole.share(speed, rate))
        speedy = [low * (1 - lasting) * share for low in lows]
        taken = [speedy, stable if braking.axle == "front" else speedy]
    span = kgs[1] - kgs[0]
    both = (wheel[0][k] < 0) & (wheel[1][k] < 0)
    for n, (first, last) in enumerate(taken):
        slope = (last - first) / span if span > 0 else np.zeros(len(k))
        mode.low1[n, k] = np.where(both, slope, 0.0)
        mode.low0[n, k] = np.where(both, first - slope * kgs[0], -np.inf)
