"""A gearbox whose losses are in a map, driven forward: against one efficiency, and against the backward step."""

from pathlib import Path

import numpy as np
import pytest
from forward.drives import constant, follow, ramp

from hevopt import DataError, build_problem, drive, load_architecture, performance, simulate
from hevopt.car.handling import DriverGains, Handling
from hevopt.forward.lines import line_of
from hevopt.forward.plans import replay_of
from hevopt.strategies import STRATEGIES
from hevopt.studies.case import prepare
from hevopt.studies.solved import run_case

SPEEDS_RPM, TORQUES = [0.0, 1500.0, 3000.0, 8000.0], [-500.0, -50.0, 0.0, 60.0, 250.0, 600.0]


def flat(torque):
    """What one efficiency of 0.95 loses."""
    return 0.05 * torque if torque > 0 else -torque * (1 / 0.95 - 1)


def curved(speed_rpm, torque, gear):
    """Drag that grows with speed and gear, and a share of the torque."""
    return 0.4 + 0.1 * gear + 4e-4 * speed_rpm + 0.025 * abs(torque) + 2e-5 * torque**2


@pytest.fixture
def box(tmp_path, monkeypatch):
    """(losses of speed, torque, gear; scale of its torques) -> A's gearbox with that map; flat without any."""
    monkeypatch.chdir(tmp_path)

    def written(losses=lambda speed, torque, gear: flat(torque), scale=1.0):
        rows = ["name = 'mapped'", "final_drive_ratio = 3.40",
                "ratios = [4.066, 2.219, 1.402, 1.026, 0.813, 0.676]", "shift_gap_s = 0.5", "[shift_speeds]",
                "up_kmh = [15, 35, 50, 70, 100]", "down_kmh = [10, 28, 42, 60, 88]"]  # fmt: skip
        for gear in range(1, 7):
            # Grids of several sizes, as the widest one's is that of all.
            speeds = SPEEDS_RPM[: 3 + gear % 2]
            torques = [scale * t for t in TORQUES if gear % 2 or t != 60.0]
            table = [[float(losses(s, t, gear)) for t in torques] for s in [*speeds[:-1], 8000.0]]
            rows += ["[[loss_map]]", f"speed_rpm = {[*speeds[:-1], 8000.0]}", f"torque_nm = {torques}",
                     f"loss_nm = {table}"]  # fmt: skip
        Path("mapped.toml").write_text("\n".join(rows) + "\n")
        return {"gearbox": "./mapped.toml"}

    return written


def planned(name, cycle, changes):
    """A usual plan of a car."""
    car = load_architecture(name, changes)
    problem = build_problem(car, cycle, allow_shortfall=True)
    strategy = "baseline" if name == "A" else "conventional"
    plan = simulate(problem, STRATEGIES[strategy].solve(problem).control)
    return replay_of(plan, line_of(car))


def replayed(name, cycle, changes):
    """A usual plan of a car, driven."""
    return follow(load_architecture(name, changes), cycle, planned(name, cycle, changes))


@pytest.mark.parametrize("name", ["A", "C2", "D"])
def test_a_map_of_one_efficiency_drives_as_that_efficiency_does(box, name):
    road = ramp(18, 14, 45)
    mapped, plain = replayed(name, road, box()), replayed(name, road, {})
    # Engine and machine are asked with what the map took in the step before.
    assert mapped.fuel_kg == pytest.approx(plain.fuel_kg, rel=1e-4)
    assert mapped.speed_mps == pytest.approx(plain.speed_mps, abs=0.01)
    lost = [float(run.books.flows["gearbox_loss_w"].sum()) for run in (mapped, plain)]
    assert lost[0] == pytest.approx(lost[1], rel=1e-3) and lost[0] > 0


@pytest.mark.parametrize("name", ["A", "C2", "D"])
def test_energy_closes_with_a_map(box, name):
    run = replayed(name, ramp(18, 14, 45), box(curved))
    assert max(run.residual.values()) < 1e-9
    assert run.books.flows["gearbox_loss_w"].min() >= 0
    assert not run.missed and not run.books.off_map.any()


@pytest.mark.parametrize("name", ["A", "C2"])
def test_at_constant_speed_the_map_says_what_it_does_backward(box, name):
    car, cycle = load_architecture(name, box(curved)), constant(70)
    strategy = "baseline" if name == "A" else "dp"
    run = drive(car, cycle, strategy, handling=Handling(driver=DriverGains(charge_per_s=0.0))).run
    backward = run_case(prepare(car, cycle), strategy)[2].flows
    for flow in ("engine_torque_nm", "machine_torque_nm", "gearbox_loss_w", "fuel_power_w"):
        assert run.books.flows[flow][-1] == pytest.approx(backward[flow][-1], rel=1e-9, abs=1e-9)
    assert run.books.flows["gearbox_loss_w"][-1] > 100


def test_full_pedal_with_a_map_of_one_efficiency_is_that_of_the_efficiency(box):
    mapped, plain = performance(load_architecture("A", box())), performance(load_architecture("A"))
    for kmh in (40, 80, 100, 140):
        assert mapped.to_speed_s[kmh] == pytest.approx(plain.to_speed_s[kmh], abs=0.02)
    assert mapped.top_mps == pytest.approx(plain.top_mps, rel=1e-3)
    assert mapped.slope == pytest.approx(plain.slope, rel=1e-3)


def test_what_leaves_the_map_is_marked(box):
    road = ramp(18, 14, 25)
    known = replayed("A", road, box())
    assert not known.books.off_map.any()
    car = load_architecture("A", box(scale=0.1))
    run = follow(car, road, planned("A", road, box()))
    inside = np.abs(known.books.flows["clutch_torque_nm"]) < 40
    assert run.books.off_map.any() and not run.books.off_map[inside].all()
    assert max(run.residual.values()) < 1e-9


def test_two_gearboxes_with_a_map_are_refused(box):
    with pytest.raises(DataError, match="loss_map is of more than one gearbox"):
        line_of(load_architecture("E", box()))
