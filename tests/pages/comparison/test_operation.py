"""Modes of operation, spells and limits."""

import numpy as np
import pytest

from hevopt.pages.comparison.operation import OPERATIONS, spells_s


def test_spells_are_the_lengths_of_what_lasts():
    on = np.array([0, 0, 1, 1, 1, 0, 1], dtype=bool)
    assert spells_s(on, np.array([1.0, 2, 1, 1, 1, 4, 0.5])) == ([3.0, 0.5], [3.0, 4.0])
    assert spells_s(np.ones(3, dtype=bool), np.ones(3)) == ([3.0], [])


def test_shares_are_the_whole_cycle_and_all_of_its_fuel(nedc):
    for row in nedc.results.rows:
        case, _, trajectory = nedc.solved[row.figures.architecture, row.figures.strategy]
        shares = row.detail.shares
        assert sum(share.time_s for share in shares) == case.cycle.duration_s
        assert sum(share.distance_m for share in shares) == pytest.approx(case.cycle.distance_m)
        assert sum(share.fuel_kg for share in shares) == pytest.approx(trajectory.total_fuel_kg)
        assert sum(share.nox_kg for share in shares) == pytest.approx(trajectory.total_nox_kg)


def test_modes_say_what_powers_do(nedc):
    table = nedc.solved["D", "nox_cut"][0].problem.table
    for row in nedc.results.rows:
        if row.figures.architecture != "D":
            continue
        trajectory = nedc.solved["D", row.figures.strategy][2]
        names = np.array(OPERATIONS)[row.detail.trace.operation]
        f, battery = trajectory.flows, trajectory.battery_power_w
        machine = f["machine_torque_nm"] * f["machine_speed_radps"]
        fuel, speed = f["fuel_power_w"], table.signals.speed_mps
        assert (speed[np.char.startswith(names, "standing")] == 0).all()
        assert (f["wheel_power_w"][np.char.startswith(names, "braking")] < 0).all()
        assert (battery[names == "braking, recovering"] < 0).all()
        assert (fuel[names == "electric driving"] == 0).all()
        assert (machine[names == "engine, machine assists"] > 0).all()
        assert (battery[names == "engine, charging"] < 0).all()
        assert (fuel[np.char.startswith(names, "engine")] > 0).all()


def test_engine_spells_agree_with_its_starts(nedc):
    for row in nedc.results.rows:
        detail, starts = row.detail, row.figures.engine_starts
        assert sum(detail.engine_on_s) + sum(detail.engine_off_s) == 1180
        assert len(detail.engine_on_s) - starts in (0, 1)


def test_limits_count_the_steps_at_the_machine_s_limit(nedc):
    detail = next(
        r.detail for r in nedc.results.rows if (r.figures.architecture, r.figures.strategy) == ("D", "dp")
    )  # fmt: skip
    case, _, trajectory = nedc.solved["D", "dp"]
    torque, speed = (trajectory.flows[f"machine_{name}"] for name in ("torque_nm", "speed_radps"))
    machine = case.car.machines[0]
    near = (np.abs(torque) > 0.99 * machine.torque_max_nm) | (
        np.abs(torque * speed) > 0.99 * machine.power_max_w
    )
    assert detail.limits["machine torque or power"] == near.sum() > 0


def test_neutral_means_the_same_of_members_and_rows(nedc):
    found = set()
    for row in nedc.results.rows:
        case, plan, _ = nedc.solved[row.figures.architecture, row.figures.strategy]
        for member, note in zip(
            row.detail.calibration, plan.notes.get("calibration", []), strict=False
        ):
            fuel_j = case.car.engine.heating_value_jpkg * note["cost_kg"]
            within = 100 * abs(member.surplus_j) <= fuel_j
            assert member.neutral == (within and note["inside"])
            found.add((member.neutral, note["eligible"]))
    # By the worth of its charge in fuel, the stricter measure, a member may still be off.
    assert found >= {(True, True), (True, False), (False, False)}
