"""P0+P4 once more in plain numbers: torque of the engine, fuel and battery power of a plan's steps."""

from dataclasses import replace
from math import pi, sqrt

import numpy as np
import pytest

from hevopt import build_problem, load_architecture, load_cycle, simulate, solve

CAR = load_architecture("p0_p4_diesel")
NEDC = load_cycle("nedc")
PART = replace(
    NEDC,
    **{
        name: getattr(NEDC, name)[:196]
        for name in ("time_s", "speed_mps", "grade", "gear", "clutch_open")
    },
)
MASS_KG, RADIUS_M, HEAT_JPKG = 1300.0 + 90.0, 0.3132, 42.9e6
GEARS = (4.066, 2.219, 1.402, 1.026, 0.813, 0.676)


def fuel_kgps(nm: float, radps: float) -> float:
    """By the published coefficients: the quadratic for the fuel mean pressure, solved."""
    displacement, stroke = 1.598e-3, 0.0805
    turns = radps / (2 * pi)
    cm, p_me = 2 * stroke * turns, 4 * pi * nm / displacement / 1e5
    slope = 0.39902 + 0.031510 * cm - 0.0022991 * cm**2
    loss = -1.55291 - 0.0076 * cm**2
    p_mf = (-slope + sqrt(slope**2 - 4 * -0.0013733 * (loss - p_me))) / (2 * -0.0013733)
    return max(p_mf, 0.0) * 1e5 * displacement * turns / 2 / HEAT_JPKG


def by_hand(k: int, belt_nm: float, rear_nm: float, brake_nm: float) -> tuple[float, float, float]:
    """Engine torque, fuel flow and battery power at a step with its clutch closed, the other torques given."""
    dt = PART.time_s[k + 1] - PART.time_s[k]
    v, a = (
        (PART.speed_mps[k + 1] + PART.speed_mps[k]) / 2,
        (PART.speed_mps[k + 1] - PART.speed_mps[k]) / dt,
    )
    road = MASS_KG * 9.80665 * (0.009 + 5e-5 * v) + 0.5 * 1.2 * 0.672 * v * v
    wheel_nm = (road + (MASS_KG + 2.8 / RADIUS_M**2) * a) * RADIUS_M
    # The rear axle first, then what is left for the gearbox.
    rear_radps, rear_in = 4.5 * v / RADIUS_M, rear_nm - 0.074 * 4.5 * a / RADIUS_M
    rear_out = rear_in * 4.5 * (0.97 if rear_in > 0 else 1 / 0.97)
    left = wheel_nm - rear_out + brake_nm
    ratio = GEARS[PART.gear[k] - 1] * 3.40
    into_box = left / ratio / (0.95 if left > 0 else 1 / 0.95)
    radps = ratio * v / RADIUS_M
    engine_nm = into_box - belt_nm + 0.18 * ratio * a / RADIUS_M
    belt_w = belt_nm * radps
    belt_electric = belt_w / 0.75 if belt_w > 0 else belt_w * 0.75
    loss = 54.7 + 0.296 * rear_radps + 0.00204 * rear_radps**2 + 0.194 * rear_nm**2
    battery_w = belt_electric + rear_nm * rear_radps + loss + 250.0
    return engine_nm, fuel_kgps(engine_nm, radps), battery_w


def test_steps_of_a_plan_are_what_plain_numbers_say():
    problem = build_problem(CAR, PART, levels=15)
    run = simulate(problem, solve(problem).control)
    flows, compared, fired = run.flows, 0, 0
    speed = (
        np.array([0.0, *GEARS])[PART.gear[:-1]] * 3.40 * problem.table.signals.speed_mps / RADIUS_M
    )
    changed = np.diff(PART.gear[:-1], prepend=PART.gear[0]) != 0
    for k in np.flatnonzero((flows["engine_speed_radps"] > 0) & ~changed & (PART.gear[:-1] > 0)):
        if abs(flows["engine_speed_radps"][k] - speed[k]) > 1e-6:
            continue  # the clutch slips or is open
        brake_nm = flows["brake_power_w"][k] / (problem.table.signals.speed_mps[k] / RADIUS_M)
        belt, rear = flows["machine_torque_nm"][k], flows["machine_2_torque_nm"][k]
        engine_nm, kgps, battery_w = by_hand(int(k), belt, rear, brake_nm)
        assert engine_nm == pytest.approx(flows["engine_torque_nm"][k], rel=1e-9, abs=1e-7)
        burnt = (run.fuel_kg[k] - run.switch_fuel_kg[k]) / problem.table.step_s[k]
        assert kgps == pytest.approx(burnt, rel=1e-9, abs=1e-12)
        assert battery_w == pytest.approx(run.battery_power_w[k], rel=1e-9, abs=1e-6)
        compared, fired = compared + 1, fired + (kgps > 0)
    assert compared > 15 and fired > 15
