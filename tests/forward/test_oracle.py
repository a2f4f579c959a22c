"""A second implementation that shares no code: a launch and a change of gear by solve_ivp, locking as an event."""

import numpy as np
from forward.plants import (
    ENGINE_KGM2,
    IDLE_RADPS,
    RADIUS_M,
    RATIO,
    body,
    inputs,
    one_gear,
    run,
    standing,
)
from scipy.integrate import solve_ivp

from hevopt.forward._rows_kernels import Ways

MASS_KG, LAG_S, R0_N, R2 = 1328.0, 0.03, 115.0, 0.4
RATIOS = (RATIO, 0.55 * RATIO)
EFFICIENCY, OPENS_S, CLOSES_S, END_S = 0.95, 3.0, 3.6, 6.0


def engine_nm(time_s):
    """Full of a launch, lifted in the gap, then pulling again."""
    return 60.0 + 8.0 * time_s if time_s < OPENS_S else -60.0 if time_s < CLOSES_S else 90.0


def capacity_nm(time_s):
    """Closing slowly at first, open in the gap, closing within 0.4 s after it."""
    if time_s < OPENS_S:
        return 50.0 + 30.0 * time_s
    return 0.0 if time_s < CLOSES_S else min(400.0, 1000.0 * (time_s - CLOSES_S))


def by_solve_ivp(at_s):
    """Speed of the car at some times: slipping and locked phases, each a set of ODEs of its own."""

    def ratio(time_s):
        return RATIOS[0] if time_s < OPENS_S else RATIOS[1]

    def drive_nm(clutch_nm, i):
        return clutch_nm * i * (EFFICIENCY if clutch_nm > 0 else 1 / EFFICIENCY)

    def road(v, force):
        return (force - (R0_N + R2 * v * v if v > 0 or force > R0_N else force)) / MASS_KG

    def slipping(time_s, y):
        v, force, n = y
        i = ratio(time_s)
        clutch = capacity_nm(time_s) * np.sign(n - i * v / RADIUS_M)
        wheel = drive_nm(clutch, i)
        return [
            road(v, force),
            (wheel / RADIUS_M - force) / LAG_S,
            (engine_nm(time_s) - clutch) / ENGINE_KGM2,
        ]

    def locked(time_s, y):
        v, force, _ = y
        i = ratio(time_s)
        accel = road(v, force)
        clutch = engine_nm(time_s) - ENGINE_KGM2 * i * accel / RADIUS_M
        return [accel, (drive_nm(clutch, i) / RADIUS_M - force) / LAG_S, i * accel / RADIUS_M]

    def meets(time_s, y):
        return y[2] - ratio(time_s) * y[0] / RADIUS_M

    meets.terminal = True
    y, t, found, phase = [0.0, 0.0, 2 * IDLE_RADPS], 0.0, [], slipping
    for end in (OPENS_S, CLOSES_S, END_S):
        phase = slipping
        while t < end - 1e-12:
            events = meets if phase is slipping and capacity_nm(0.5 * (t + end)) > 0 else None
            done = solve_ivp(phase, (t, end), y, events=events, rtol=1e-9, atol=1e-10, max_step=0.01,
                             dense_output=True, method="LSODA")  # fmt: skip
            found.append((t, done.t[-1], done.sol))
            t, y = done.t[-1], done.y[:, -1]
            phase = locked
    return np.array([next(sol(s)[0] for a, b, sol in found if a <= s <= b + 1e-12) for s in at_s])


def test_a_launch_and_a_change_of_gear_agree_with_solve_ivp():
    gears = [one_gear(EFFICIENCY), one_gear(EFFICIENCY)]
    gears[1].wheel[:, -1] = gears[1].sense[:, :, 0] = RATIOS[1]
    inertia = gears[0].inertia_kgm2
    ways = Ways(
        *(np.concatenate(parts) for parts in zip(*(g[:7] for g in gears), strict=True)), inertia
    )
    car = body((R0_N, 0, 0, 0), (0, 0, R2, 0), lag_s=LAG_S)._replace(equivalent_kg=MASS_KG)

    def acting(time_s, state):
        return inputs(
            engine_nm=engine_nm(time_s), capacity_nm=capacity_nm(time_s), way=int(time_s >= OPENS_S),
            from_way=int(time_s >= OPENS_S),
        )  # fmt: skip

    step_s = 0.001
    states, _ = run(
        car, ways, standing(side_radps=2 * IDLE_RADPS), acting, step_s, round(END_S / step_s)
    )
    at_s = np.linspace(0.1, END_S - 0.01, 60)
    ours = np.interp(at_s, step_s * np.arange(len(states)), [s.speed_mps for s in states])
    theirs = by_solve_ivp(at_s)
    assert ours[-1] > 5
    assert np.abs(ours - theirs).max() < 1e-3
