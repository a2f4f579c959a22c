"""What `hevopt maps import` makes of a machine's points, against the formula that they were sampled from."""

import numpy as np
import pytest
from map_bench import RPM, car_with, write

from hevopt import load_architecture
from hevopt.measured.maps.plot import label_places

MACHINE = load_architecture("C2").machines[0]
LIKE = ("--like", "machine_flywheel_18kw")
IMPORT = ("maps", "import", "m.csv", "--kind", "machine", *LIKE)
SPEEDS = (250, 500, 1000, 1500, 2000, 2500, 3000, 4000, 5000, 6000)


def bench(signs=(1, -1)) -> tuple[np.ndarray, ...]:
    """rpm, Nm, shaft power and loss at shares of the limit, as a bench without a no-load test measures them."""
    rpm = np.repeat(SPEEDS, 7)
    torque = MACHINE.limit_nm(rpm * RPM)
    torque = torque * np.tile([0.05, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0], len(SPEEDS))
    rpm, torque = np.tile(rpm, len(signs)), np.concatenate([sign * torque for sign in signs])
    return rpm, torque, rpm * RPM * torque, MACHINE.loss_w(torque, rpm * RPM)


@pytest.mark.parametrize("signs", [(1,), (1, -1)])
def test_the_loss_without_torque_is_assumed_near_the_truth_and_leaves_no_band(hevopt, signs):
    rpm, torque, power, loss = bench(signs)
    efficiency = np.where(power > 0, power / (power + loss), (power + loss) / power)
    write("m.csv", "speed [rpm],torque [Nm],efficiency [%]", rpm, torque, 100 * efficiency)
    seen = hevopt(*IMPORT)
    assert seen.status == 0, seen
    assert (
        "not measured at 10 of 10 speeds (250 to 6000 rpm); ASSUMED to be that of the" in seen.out
    )
    machine = load_architecture(car_with("machine", "m.toml")).machines[0]
    speed, share = np.meshgrid(np.linspace(250, 6000, 116) * RPM, np.linspace(-0.12, 0.12, 41))
    load = share * MACHINE.limit_nm(speed)
    found = machine.loss_w(load, speed)
    assert not np.isnan(found).any()
    truth = MACHINE.loss_w(load, speed)
    # The loss at the lowest torque measured is 7 W above that at 0; the rest is the bend over speed.
    assert np.abs(found - truth).max() < 25 and np.abs(found - truth).mean() < 8


def test_a_measured_loss_without_torque_is_kept(hevopt):
    rpm, torque, _, loss = bench()
    still = MACHINE.loss_w(np.zeros(len(SPEEDS)), np.array(SPEEDS) * RPM)
    columns = [*rpm, *SPEEDS], [*torque, *(0.0 for _ in SPEEDS)], [*loss, *still]
    write("m.csv", "speed [rpm],torque [Nm],loss [W]", *columns)
    seen = hevopt(*IMPORT)
    assert seen.status == 0 and "ASSUMED" not in seen.out, seen
    machine = load_architecture(car_with("machine", "m.toml")).machines[0]
    found = machine.loss_w(np.zeros(len(SPEEDS)), np.array(SPEEDS) * RPM)
    np.testing.assert_allclose(found, still, rtol=1e-6)


@pytest.mark.parametrize("scale", [1.0, 1.5])
def test_the_full_load_curve_is_the_limit_and_the_map_reaches_up_to_it(hevopt, scale):
    rpm, torque = np.meshgrid([0.0, *SPEEDS], np.linspace(-120, 120, 25))
    loss = MACHINE.loss_w(torque, rpm * RPM)
    columns = "speed [rpm],torque [Nm],loss [W]", rpm.ravel(), torque.ravel(), loss.ravel()
    write("m.csv", *columns)
    # A curve that bends where the map has no line, partly well below the hyperbola of its largest power.
    curve_rpm, curve_nm = np.array([0, 1100, 2700, 6000]), np.array([97.0, 97.0, 41.0, 12.0])
    write("full.csv", "speed [rpm],torque [Nm]", curve_rpm, curve_nm)
    seen = hevopt(*IMPORT, "--full-load", "full.csv")
    assert seen.status == 0 and "full-load curve: torque is straight" in seen.out, seen
    car = load_architecture(car_with("machine", "m.toml"), {"machine.scale.power": scale})
    speed = np.linspace(0, 6000, 241)
    limit = car.machines[0].limit_nm(speed * RPM)
    most_w = (curve_nm * curve_rpm * RPM).max()
    straight = np.interp(speed, curve_rpm, curve_nm)
    expected = np.minimum(straight, most_w / np.maximum(speed * RPM, 1e-9))
    assert (expected < straight).any() and (expected == straight).any()
    np.testing.assert_allclose(limit, scale * expected, rtol=1e-5)
    for sign in (1, -1):
        found = car.machines[0].loss_w(sign * limit, speed * RPM)
        assert not np.isnan(found).any()
    assert car.machines[0].limit_nm(np.array([6001 * RPM])) == 0


def test_electric_power_without_its_sign_while_generating_is_refused(hevopt):
    rpm, torque, power, loss = bench()
    write("m.csv", "speed [rpm],torque [Nm],electric power [W]", rpm, torque, abs(power + loss))
    seen = hevopt(*IMPORT)
    assert seen.status == 2 and "electric power is negative while generating" in seen.err, seen
    assert "m.csv, lines 7" in seen.err and seen.out == ""
    write("m.csv", "speed [rpm],torque [Nm],electric power [W]", rpm, torque, power + loss)
    assert hevopt(*IMPORT).status == 0


def test_efficiency_above_all_is_named_with_its_line_and_how_it_was_read(hevopt):
    rpm, torque, power, loss = bench((1,))
    efficiency = 100 * power / (power + loss)
    efficiency[4] = 104
    write("m.csv", "speed [rpm],torque [Nm],efficiency [%]", rpm, torque, efficiency)
    seen = hevopt(*IMPORT)
    assert seen.status == 2 and "line 6: efficiency up to 1.04; allowed: up to 1" in seen.err, seen
    assert "efficiency [%] in % (header)" in seen.err


def test_labels_of_lines_that_meet_at_no_torque_stand_apart():
    along = np.linspace(0, 1, 200)
    lines = [np.stack([along, sign * level / (0.02 + along)], axis=1)
             for sign in (1, -1) for level in (0.002, 0.004, 0.008, 0.016)]  # fmt: skip
    places = label_places([*lines, np.array([[0.5, 0.5], [0.51, 0.5]]), np.empty((0, 2))])
    assert len(places) >= 2
    for n, (x, y) in enumerate(places):
        assert abs(y) >= 0.06 and any(np.min(np.hypot(*(line - (x, y)).T)) < 1e-9 for line in lines)
        assert all(np.hypot(x - u, y - v) >= 0.06 for u, v in places[:n])
    wide = [np.array([[0, h], [0.3, h], [0.5, h], [0.7, h], [1, h]]) for h in (0.3, 0.6, -0.4)]
    assert [tuple(place) for place in label_places(wide)] == [(0.5, 0.3), (0.5, 0.6), (0.5, -0.4)]
