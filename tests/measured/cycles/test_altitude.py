"""Grade from altitude: hills keep their climb and their work, noise makes none."""

import numpy as np
import pytest

from hevopt import load_architecture, load_cycle
from hevopt.driving.demand import demand_of
from hevopt.errors import DataError
from hevopt.measured.cycles.altitude import grade_from_altitude
from hevopt.measured.cycles.cycle import import_cycle

TIME_S = np.arange(601.0)
SPEED_MPS = np.interp(TIME_S, [0, 10, 40, 560, 590, 600], [0, 0, 20, 20, 0, 0])


def distance(time_s, speed_mps):
    return np.concatenate([[0], np.cumsum(np.diff(time_s) * (speed_mps[1:] + speed_mps[:-1]) / 2)])


DISTANCE_M = distance(TIME_S, SPEED_MPS)


def imported(tmp_path, altitude_m, time_s=TIME_S, speed_mps=SPEED_MPS, **options):
    path = tmp_path / "drive.csv"
    rows = zip(time_s, speed_mps, altitude_m, strict=True)
    path.write_text(
        "time_s,speed_mps,altitude_m\n" + "".join(f"{t:.9g},{v:.9g},{h:.9g}\n" for t, v, h in rows)
    )
    return import_cycle(path, columns={"altitude": "altitude_m"}, **options)


def climbs(cycle):
    """Climb and fall of a cycle file's grade."""
    steps_m = np.diff(cycle.time_s) * (cycle.speed_mps[1:] + cycle.speed_mps[:-1]) / 2
    rises_m = steps_m * np.sin(np.arctan(cycle.grade[:-1]))
    return rises_m[rises_m > 0].sum(), -rises_m[rises_m < 0].sum()


def positive_work(tmp_path, cycle_text):
    out = tmp_path / "cycle.csv"
    out.write_text(cycle_text)
    car = load_architecture("A")
    demand = demand_of(load_cycle(out), car.vehicle, car.gearbox)
    return np.sum(np.maximum(demand.wheel_power_w, 0) * demand.step_s), np.sum(
        demand.wheel_power_w * demand.step_s
    )


@pytest.mark.parametrize("length_m", [1000, 2000, 5000])
def test_a_smooth_hill_keeps_its_climb(tmp_path, length_m):
    # 4 % at most, up and down again.
    height_m = 0.04 * length_m / np.pi / 2
    altitude_m = 400 + height_m * (1 - np.cos(2 * np.pi * DISTANCE_M / length_m))
    result = imported(tmp_path, altitude_m)
    steps_m = np.diff(altitude_m)
    up, down = climbs(result.cycle)
    assert up == pytest.approx(steps_m[steps_m > 0].sum(), rel=0.012)
    assert down == pytest.approx(-steps_m[steps_m < 0].sum(), rel=0.012)
    assert not result.hints and any("through 100 m of road" in text for text in result.rules)


def test_a_mountain_road_costs_m_g_h(tmp_path):
    altitude_m = 400 + 150 * (1 - np.cos(np.pi * DISTANCE_M / DISTANCE_M[-1]))
    flat = imported(tmp_path, np.full(601, 400.0))
    hill = imported(tmp_path, altitude_m)
    works = [positive_work(tmp_path, result.text)[1] for result in (flat, hill)]
    weight_n = load_architecture("A").vehicle.mass_kg * 9.80665
    # Rolling resistance falls with the cosine, at most 0.3 % of the weight's share.
    assert works[1] - works[0] == pytest.approx(weight_n * 300, rel=0.01)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_noise_of_an_altimeter_makes_no_hills(tmp_path, seed):
    rng = np.random.default_rng(seed)
    flat = positive_work(tmp_path, imported(tmp_path, np.full(601, 400.0)).text)[0]
    steps = np.round(400.5 + rng.normal(0, 0.3, 601))
    for altitude_m, more in ((400 + rng.normal(0, 1, 601), 0.05), (steps, 0.03)):
        noisy = imported(tmp_path, altitude_m)
        assert np.abs(noisy.cycle.grade).mean() < 0.004
        assert positive_work(tmp_path, noisy.text)[0] == pytest.approx(flat, rel=more)
    assert any("noise of the altitude about" in text for text in noisy.rules)


def test_hills_under_noise_keep_their_climb(tmp_path):
    rng = np.random.default_rng(5)
    altitude_m = 400 + 60 * (1 - np.cos(2 * np.pi * DISTANCE_M / 5500))
    result = imported(tmp_path, altitude_m + rng.normal(0, 1, 601))
    assert climbs(result.cycle)[0] == pytest.approx(240, rel=0.05)


def test_an_altimeter_of_whole_metres_gives_the_roads_grade(tmp_path):
    time_s = np.arange(6001) / 10
    speed_mps = np.interp(time_s, TIME_S, SPEED_MPS)
    altitude_m = np.round(400 + 0.03 * distance(time_s, speed_mps))
    cycle = imported(tmp_path, altitude_m, time_s, speed_mps).cycle
    assert cycle.grade[30:570] == pytest.approx(0.03, abs=0.005)
    assert climbs(cycle) == pytest.approx((0.03 * DISTANCE_M[-1], 0), rel=0.01, abs=0.01)


def test_hills_that_are_undone_at_once_are_told(tmp_path):
    waves_m = 400 + 2 * np.sin(2 * np.pi * DISTANCE_M / 240)
    (hint,) = imported(tmp_path, waves_m).hints
    assert "climb are undone within 300 m" in hint and "--altitude-baseline 500" in hint
    assert not imported(tmp_path, waves_m, altitude_baseline_m=500).hints


def test_the_baseline_may_be_given(tmp_path):
    altitude_m = 400 + 10 * np.sin(2 * np.pi * DISTANCE_M / 1000)
    result = imported(tmp_path, altitude_m, altitude_baseline_m=500)
    assert any(
        "through 500 m of road around each point (--altitude-baseline" in t for t in result.rules
    )
    # 3 (sin x - x cos x) / x³ for x = π/2 of the climb is left.
    ideal = climbs(imported(tmp_path, altitude_m, altitude_baseline_m=20).cycle)[0]
    x = np.pi / 2
    assert climbs(result.cycle)[0] / ideal == pytest.approx(3 / x**3, rel=0.03)
    for wrong in (0, 19, 5001, -1, float("nan")):
        with pytest.raises(DataError, match="allowed: 20 to 5000 m"):
            imported(tmp_path, altitude_m, altitude_baseline_m=wrong)
    with pytest.raises(DataError, match="--altitude-baseline without an altitude"):
        import_cycle(tmp_path / "drive.csv", altitude_baseline_m=100)


def test_short_and_resting_drives_have_a_grade():
    for count in (2, 3, 50):
        road = grade_from_altitude(np.linspace(0, 15, count), np.linspace(0, 0.3, count), None)
        assert road.grade == pytest.approx(0.02 / np.sqrt(1 - 0.02**2)) and not road.hint
    along_m = np.repeat(np.arange(0, 500, 25.0), 7)
    road = grade_from_altitude(along_m, 0.03 * along_m, None)
    assert road.grade == pytest.approx(0.03 / np.sqrt(1 - 0.03**2), abs=1e-9)
