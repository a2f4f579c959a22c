"""Compiled step of the driven car: implicit, stable at any length, exact in energy.

With all inertias as torques  -J (speed after - speed before) / h  on their own units (_rows_kernels),
one step from wheels' speed w and engine side's speed n is

    w' = w + h (F_mean - F_road) / (R m)                                                           (5)
    F' = decay F + (1 - decay) T/R,   F_mean = w0 F + w1 T/R          the lag (2), exact over the step
    T = Σ a q (torque - inertia) - brake,   Σ b p (torque - inertia) - T_clutch = 0

linear in w', n' and the clutch's torque, which is what holds both sides together within ± its
capacity (16): Coulomb friction, implicit, without events. The brake is Coulomb friction as well. What a torque
converter takes from n and gives towards w at the mean speeds of the step is made linear around a guess.
Powers taken with the mean of the speeds before and after are exact differences of kinetic energy.
"""

import numpy as np

from hevopt._compile import compiled
from hevopt.forward._contact_kernels import Body, Pace, grip_n, resistance
from hevopt.forward._round_kernels import SETTLED, flow_of, flowing_nm, found_of, row_of
from hevopt.forward._rows_kernels import Array, Inputs, Outputs, State, Ways, turning
from hevopt.forward._slip_kernels import slip_step
from hevopt.forward._solve_kernels import Motion, SolvedStep, reached, solve, sums

# Rounds of guessing the directions of power, each flipping those that proved wrong, and what a map says is lost.
_ROUNDS = 12


@compiled(bare=True)
def step(
    body: Body, ways: Ways, rows: Array, state: State, inputs: Inputs, pace: Pace, row: Array
) -> tuple[State, Outputs]:
    """State after a step, and what acted in it; state and inputs are left as they are.

    rows: settled_rows(ways); pace: pace_of(step, lag of the tyre); row: as long as one of rows, for moving ratios
    """
    if body.tyre.slips:
        return slip_step(body, ways, rows, state, inputs, pace, row)
    wheel, per_s = state.speed_mps / body.radius_m, 1.0 / pace.step_s
    passive, rise, along = resistance(state.speed_mps, inputs.slope_rad, body)
    per_n = pace.step_s / (body.radius_m * body.equivalent_kg)
    of_torque = 1.0 - pace.of_force
    own = 1.0 + 0.5 * pace.step_s / body.equivalent_kg * rise
    motion = Motion(
        per_n * (pace.of_force * state.force_n - passive - along), own, per_n * of_torque / body.radius_m
    )  # fmt: skip
    grip = grip_n(passive + along, inputs.slope_rad, body)
    top = max((motion.rest + per_n * of_torque * grip) / own, -wheel)
    governed = np.nan if inputs.governed_radps < 0.0 else inputs.governed_radps - state.side_radps
    flows = inputs.flows and len(ways.fluid.pieces.speed_ratio) > 0
    ratio = turning(
        ways.wheel, inputs.way, inputs.from_way, inputs.blend, len(ways.inertia_kgm2) - 1
    )
    slip = state.side_radps - ratio * wheel
    moving = state.blend > 0.0 or inputs.blend > 0.0 or state.way != inputs.way

    variant = state.variant
    guess_wheel, guess_side, guess_nm = 0.0, 0.0, state.lost_nm
    rest = motion
    for n in range(_ROUNDS):
        lost = guess_nm
        row = row_of(
            ways, rows, state, inputs, variant, moving, wheel, guess_wheel, guess_side, row
        )
        flow = flow_of(ways, state, inputs, ratio, wheel, guess_wheel, guess_side)
        s = sums(row, inputs.machine_nm, inputs.brake_nm, slip, per_s, lost, flow)
        solved = solve(s, motion, governed, inputs.engine_nm, inputs.low_nm, inputs.high_nm,
                        inputs.capacity_nm)  # fmt: skip
        if solved.wheel > top or solved.wheel < -wheel:
            rest = Motion(top if solved.wheel > top else -wheel, 1.0, 0.0)
            free = solved
            solved = solve(s, rest, governed, inputs.engine_nm, inputs.low_nm, inputs.high_nm,
                            inputs.capacity_nm)  # fmt: skip
            solved = SolvedStep(rest.rest, *solved[1:])
            if free.wheel > top and reached(s, motion, solved) < motion.own * top:
                solved = free
        flowing = flowing_nm(flow, solved)
        found, guess_nm = found_of(
            ways, row, state, inputs, variant, solved, ratio, wheel, per_s, lost, flowing[1]
        )
        still = abs(solved.wheel - guess_wheel) <= SETTLED * wheel
        still &= abs(solved.side - guess_side) <= SETTLED * state.side_radps
        still |= not (moving or flows)
        still &= found == variant and abs(guess_nm - lost) <= SETTLED * max(lost, 1.0)
        # Where the teeth turn as one no direction proves right: the last one tried is that of the solution.
        if still or n == _ROUNDS - 1:
            break
        variant, guess_wheel, guess_side = found, solved.wheel, solved.side

    drive = (
        s.known + inputs.brake_nm + s.engine * solved.engine_nm + s.clutch * solved.clutch_nm
        - s.per_w * solved.wheel - s.per_n * solved.side
    )  # fmt: skip
    return _after(
        body, state, inputs, pace, solved, variant, lost, drive, top, passive, rise, along, flowing
    )


@compiled(bare=True)
def _after(
    body: Body, state: State, inputs: Inputs, pace: Pace, solved: SolvedStep, variant: int, lost: float,
    drive: float, top: float, passive: float, rise: float, along: float, flowing: tuple[float, float],
) -> tuple[State, Outputs]:  # fmt: skip
    """State and outputs; where the wheels' speed is a limit's, brakes or the road take what is over."""
    gained = solved.wheel * body.radius_m
    speed = state.speed_mps + gained
    road = passive + 0.5 * rise * gained
    of_torque = 1.0 - pace.of_force
    brake, held = inputs.brake_nm, 0.0
    needed_n = body.equivalent_kg * gained / pace.step_s + road + along
    stopped = solved.wheel == -state.speed_mps / body.radius_m
    if stopped:
        # Where the car comes to rest so does the tyre: no lag, and none of its braking force is left.
        over = drive - brake - needed_n * body.radius_m
        if over > 0.0:
            brake += over
        else:
            given = min(-over, max(road, 0.0) * body.radius_m)
            road -= given / body.radius_m
            released = min(-over - given, brake)
            brake -= released
            held = -over - given - released
        torque = drive - brake + held
        mean = torque / body.radius_m
        left = max(state.force_n, 0.0)
        # At rest the force builds up behind what drives until it moves the car.
        holding = inputs.brake_nm if state.speed_mps == 0.0 else brake
        force = pace.decay * left + (1.0 - pace.decay) * max(drive - holding, 0.0) / body.radius_m
        speed = 0.0
    else:
        if solved.wheel == top:
            needed_nm = (needed_n - pace.of_force * state.force_n) / of_torque * body.radius_m
            brake = max(drive - needed_nm, brake)
        torque = drive - brake
        force = pace.decay * state.force_n + (1.0 - pace.decay) * torque / body.radius_m
        mean = pace.of_force * state.force_n + of_torque * torque / body.radius_m
    side = state.side_radps + solved.side
    after = State(
        speed, force, side, inputs.way, inputs.from_way, inputs.blend, variant, lost, 0.0, 0.0
    )
    outputs = Outputs(solved.engine_nm, solved.clutch_nm, torque, brake, held, mean, road + along, solved.locked,
                      *flowing)  # fmt: skip
    return after, outputs
