"""Compiled step of the driven car on tyres that slip: Pacejka's magic formula behind a relaxation length.

Beside the wheels' speed w and the engine side's, the car's speed v and the slip k are unknown:

    J (w' - w)/h = T - R F                                   the driven wheels, T what the driveline gives
    m (v' - v)/h = F - F_road - F_brake                      all else; the brakes act on all wheels, without slip
    s (k' - k)/h = R w' - v' - v' k'                         relaxation length s
    F = P(k') (load + moved F_against) / (1 + P(k') moved)   P = friction x magic formula, its peak the grip (4)

all of them at the step's end, so that neither a car at rest nor stiff tyres limit the step. F is linear in k', and
by that in w', around a guess, which is the Newton step of every round; the driveline is solved as on tyres that
roll. Powers are taken with the mean of the speeds before and after, so that F (R w - v) is what the tyres take:
v' F k' of it slides, never negative, the rest bends them and comes back, less what the implicit step damps.
"""

from typing import NamedTuple

import numpy as np

from hevopt._compile import compiled
from hevopt.forward._contact_kernels import (
    Body,
    Pace,
    pacejka_share,
    pacejka_slope,
    resistance,
    wheel_radps,
)
from hevopt.forward._round_kernels import SETTLED, flow_of, flowing_nm, found_of, row_of
from hevopt.forward._rows_kernels import Array, Inputs, Outputs, State, Ways, turning
from hevopt.forward._solve_kernels import Motion, solve, sums
from hevopt.units import STANDARD_GRAVITY_MPS2

_ROUNDS = 60
# Rounds after which every other one halves what is left between a slip too low and one too high.
_NEWTONS = 8
# Slip within which a guess is settled.
_SETTLED_SLIP = 1e-11
# Of what turns with the wheels, the share of the driven axle.
DRIVEN_SHARE = 0.5
# A wheel of a standing car that turns no faster stands.
_STANDS_MPS = 1e-9


class Grip(NamedTuple):
    """The tyres' force in a round, f + slope (k' - k) for a slip near k; k' = bias + per_radps w'."""

    force_n: float
    slope_n: float
    bias: float
    per_radps: float


class Ground(NamedTuple):
    """What a step's contact is made of: load and what moves it, and the forces against the car.

    free_kg: mass that the tyres move; wheel_kgm2: inertia of the driven wheels
    level_n: load at no acceleration; moved: of the load, per force on the car; against_n: all but the tyres' force
    rise: derivative of the resistance by speed
    """

    free_kg: float
    wheel_kgm2: float
    level_n: float
    moved: float
    against_n: float
    rise: float


@compiled(bare=True)
def ground_of(state: State, inputs: Inputs, body: Body) -> Ground:
    """The contact of a step."""
    passive, rise, along = resistance(state.speed_mps, inputs.slope_rad, body)
    tyre, weight = body.tyre, body.mass_kg * STANDARD_GRAVITY_MPS2
    turning_kg = DRIVEN_SHARE * (body.equivalent_kg - body.mass_kg)
    free = body.equivalent_kg - turning_kg
    level = weight * tyre.driven_share * np.cos(inputs.slope_rad)
    level -= weight * tyre.height_share * np.sin(inputs.slope_rad)
    against = passive + along + inputs.brake_nm / body.radius_m
    return Ground(free, turning_kg * body.radius_m**2, level, tyre.height_share * body.mass_kg / free,
                  against, rise)  # fmt: skip


@compiled(bare=True)
def tyre_force_n(slip: float, ground: Ground, body: Body) -> tuple[float, float]:
    """The tyres' force at a slip, and how it rises with it; past its peak as if it rose from no slip."""
    tyre = body.tyre
    share = tyre.friction * pacejka_share(slip, tyre)
    load = max(ground.level_n + ground.moved * ground.against_n, 0.0)
    per = 1.0 + share * ground.moved
    force = share * load / per
    slope = tyre.friction * pacejka_slope(slip, tyre) * load / per**2
    return force, slope if slope > 0.0 or load == 0.0 else force / slip


@compiled(bare=True)
def _linear(
    state: State, ground: Ground, body: Body, step_s: float, slip: float, speed: float, stands: bool
) -> Grip:
    """The force around a guess of slip and speed."""
    force, slope = tyre_force_n(slip, ground, body)
    length, radius = body.tyre.relaxation_m, body.radius_m
    if stands:
        return Grip(force, slope, state.slip, step_s * radius / length)
    stiff = ground.free_kg / step_s + 0.5 * ground.rise
    at_none = state.speed_mps + (force - slope * slip - ground.against_n) / stiff
    whole = length + step_s * speed + step_s * (1.0 + slip) * slope / stiff
    bias = length * state.slip + step_s * (slip * speed - (1.0 + slip) * at_none)
    return Grip(force, slope, bias / whole, step_s * radius / whole)


@compiled(bare=True)
def slip_step(
    body: Body, ways: Ways, rows: Array, state: State, inputs: Inputs, pace: Pace, row: Array
) -> tuple[State, Outputs]:
    """`step` of _plant_kernels on tyres that slip."""
    wheel = wheel_radps(state.speed_mps, state.spin_radps, body)
    step_s, per_s, radius = pace.step_s, 1.0 / pace.step_s, body.radius_m
    ground = ground_of(state, inputs, body)
    stiff = ground.free_kg / step_s + 0.5 * ground.rise
    governed = np.nan if inputs.governed_radps < 0.0 else inputs.governed_radps - state.side_radps
    flows = inputs.flows and len(ways.fluid.pieces.speed_ratio) > 0
    ratio = turning(
        ways.wheel, inputs.way, inputs.from_way, inputs.blend, len(ways.inertia_kgm2) - 1
    )
    off = state.side_radps - ratio * wheel
    moving = state.blend > 0.0 or inputs.blend > 0.0 or state.way != inputs.way
    variant = state.variant
    guess_wheel, guess_side, guess_nm = 0.0, 0.0, state.lost_nm
    slip, speed, stands = state.slip, state.speed_mps, state.speed_mps == 0.0
    low, high = -np.inf, np.inf
    for n in range(_ROUNDS):
        lost = guess_nm
        row = row_of(
            ways, rows, state, inputs, variant, moving, wheel, guess_wheel, guess_side, row
        )
        grip = _linear(state, ground, body, step_s, slip, speed, stands)
        at_none = grip.bias + grip.per_radps * wheel - slip
        motion = Motion(
            -radius * (grip.force_n + grip.slope_n * at_none),
            ground.wheel_kgm2 * per_s + radius * grip.slope_n * grip.per_radps, 1.0,
        )  # fmt: skip
        flow = flow_of(ways, state, inputs, ratio, wheel, guess_wheel, guess_side)
        s = sums(row, inputs.machine_nm, 0.0, off, per_s, lost, flow)
        solved = solve(s, motion, governed, inputs.engine_nm, inputs.low_nm, inputs.high_nm,
                       inputs.capacity_nm)  # fmt: skip
        flowing = flowing_nm(flow, solved)
        found, guess_nm = found_of(
            ways, row, state, inputs, variant, solved, ratio, wheel, per_s, lost, flowing[1]
        )
        after = grip.bias + grip.per_radps * (wheel + solved.wheel)
        force = grip.force_n + grip.slope_n * (after - slip)
        free = state.speed_mps + (force - ground.against_n) / stiff
        still = abs(after - slip) <= _SETTLED_SLIP * (1.0 + abs(after)) and stands == (free <= 0.0)
        still = still and found == variant and abs(guess_nm - lost) <= SETTLED * max(lost, 1.0)
        if moving or flows:
            still = still and abs(solved.wheel - guess_wheel) <= SETTLED * abs(wheel)
            still = still and abs(solved.side - guess_side) <= SETTLED * state.side_radps
        if still or n == _ROUNDS - 1:
            break
        if stands != (free <= 0.0) or found != variant:
            low, high = -np.inf, np.inf
        elif after > slip:
            low = slip
        else:
            high = slip
        between = low > -np.inf and high < np.inf
        outside = not low < after < high
        slip = 0.5 * (low + high) if between and (outside or (n > _NEWTONS and n % 2)) else after
        variant, guess_wheel, guess_side = found, solved.wheel, solved.side
        stands, speed = free <= 0.0, max(free, 0.0)
    drive = s.known + s.engine * solved.engine_nm + s.clutch * solved.clutch_nm
    drive -= s.per_w * solved.wheel + s.per_n * solved.side
    speed = max(free, 0.0)
    brake, road, held = _held(state, inputs, ground, body, force, speed, step_s)
    spin = wheel + solved.wheel - speed / radius
    if speed == 0.0 and abs(spin) * radius < _STANDS_MPS:
        spin = 0.0
    end = State(speed, force, state.side_radps + solved.side, inputs.way, inputs.from_way, inputs.blend, variant,
                lost, spin, after)  # fmt: skip
    return end, Outputs(
        solved.engine_nm, solved.clutch_nm, drive, brake, held, force, road, solved.locked, *flowing
    )


@compiled(bare=True)
def _held(
    state: State, inputs: Inputs, ground: Ground, body: Body, force: float, speed: float, step_s: float
) -> tuple[float, float, float]:  # fmt: skip
    """Torque of the brakes, force of the road, and torque that holds the car: what is over where it stops."""
    radius = body.radius_m
    passive, rise, along = resistance(state.speed_mps, inputs.slope_rad, body)
    road = passive + 0.5 * rise * (speed - state.speed_mps)
    brake, held = inputs.brake_nm / radius, 0.0
    if speed == 0.0:
        over = force - brake - road - along + ground.free_kg * state.speed_mps / step_s
        if over > 0.0:
            brake += over
        else:
            given = min(-over, max(road, 0.0))
            released = min(-over - given, brake)
            road, brake, held = road - given, brake - released, -over - given - released
    return brake * radius, road + along, held * radius
