"""Standing still with a sensor that is never quite 0: told, and set to 0 where the user says below which speed."""

from pathlib import Path

import command_line
import numpy as np
import pytest

from hevopt import build_problem, load_architecture, load_cycle
from hevopt.errors import DataError
from hevopt.measured.cycles.cycle import import_cycle
from hevopt.measured.cycles.sampled import summary
from hevopt.measured.cycles.standstill import standstill_limit

HALF_KMH = 0.5 / 3.6


def drive(tmp_path, standing, name="drive.csv"):
    """60 s at rest, a ramp to 15 m/s and back, three times; at rest as `standing` has it, in m/s."""
    one = np.interp(np.arange(120), [0, 60, 80, 100, 112], [0, 0, 15, 15, 0])
    speed_mps = np.tile(one, 3)
    speed_mps[speed_mps == 0] = standing
    path = tmp_path / name
    rows = "".join(f"{t},{v:.9g}\n" for t, v in enumerate(speed_mps))
    path.write_text("time_s,speed_mps\n" + rows)
    return path


def noise(seed=0):
    return np.abs(np.random.default_rng(seed).normal(0, 0.15 / 3.6, 207))


def test_a_noisy_standstill_is_told_and_left_as_it_is(tmp_path):
    result = import_cycle(drive(tmp_path, noise()))
    (hint,) = result.hints
    assert "slower than 1 km/h for 5 s or longer" in hint and "in 4 stretches, 20" in hint
    assert "--standstill 0.5km/h" in hint and "(lines 2-62, " in hint
    assert f"# {hint}" in result.text
    assert dict(summary(result))["standstill"] == "0.0% of the time"


def test_below_the_given_speed_the_car_stands_and_the_change_is_counted(tmp_path):
    path = drive(tmp_path, noise())
    result = import_cycle(path, standstill_mps=HALF_KMH)
    truth = import_cycle(drive(tmp_path, 0.0, "truth.csv"))
    np.testing.assert_allclose(result.cycle.speed_mps, truth.cycle.speed_mps, atol=1e-6)
    assert (
        dict(summary(result))["standstill"]
        == dict(summary(truth))["standstill"]
        != "0.0% of the time"
    )
    (counted,) = (text for text in result.rules if text.startswith("standstill where"))
    lost_m = import_cycle(path).cycle.distance_m - truth.cycle.distance_m
    assert "slower than 0.5 km/h for 3 s or longer: 207 samples in 4 stretches set to 0" in counted
    assert f"{lost_m:.4g} m of the distance (lines 2-62, " in counted
    assert not result.hints and f"# made by: {counted}" in result.text


def test_the_engine_is_off_in_a_standstill_that_is_one(tmp_path):
    fuels = []
    for name, standing, limit in (("a", 0.0, None), ("b", noise(), HALF_KMH), ("c", noise(), None)):
        out = tmp_path / f"{name}_1hz.csv"
        out.write_text(
            import_cycle(drive(tmp_path, standing, f"{name}.csv"), standstill_mps=limit).text
        )
        table = build_problem(load_architecture("B"), load_cycle(out)).table
        fuels.append(np.where(table.reject == 0, table.fuel_kg, np.inf).min(axis=1).sum())
    assert fuels[1] == pytest.approx(fuels[0], rel=1e-6)
    assert fuels[2] > 1.05 * fuels[0]


def test_slow_samples_that_do_not_last_or_rest_at_0_are_driving(tmp_path):
    speeds = [0, 0, 0, 0, 0, 0, 0.1, 0.1, 2, 4, 2, 0.1, 0.1, 2, 4, 2, 0, 0]
    path = tmp_path / "drive.csv"
    path.write_text("time_s,speed_mps\n" + "".join(f"{t},{v}\n" for t, v in enumerate(speeds)))
    assert not import_cycle(path).hints
    result = import_cycle(path, standstill_mps=HALF_KMH)
    expected = [0] * 8 + speeds[8:]
    assert result.cycle.speed_mps == pytest.approx(expected)


@pytest.mark.parametrize(
    ("text", "mps"), [("0.5km/h", 0.5 / 3.6), ("0,1 m/s", 0.1), ("1mph", 0.44704)]
)
def test_the_speed_has_a_unit(text, mps):
    assert standstill_limit(text) == pytest.approx(mps)


@pytest.mark.parametrize("text", ["0.5", "km/h", "0km/h", "-1km/h", "6km/h", "1s", "1 furlong", ""])
def test_a_speed_without_unit_or_out_of_range_is_refused(text):
    with pytest.raises(DataError, match="allowed: a speed with its unit, above 0 to 5 km/h"):
        standstill_limit(text)


def test_the_command_takes_it_and_refuses_it_over_distance(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    drive(tmp_path, noise())
    Path("route.vdri").write_text("<s>,<v>\n0,0\n100,36\n200,0\n")

    def call(*words):
        return command_line.call(monkeypatch, capsys, "cycles", "import", *words)

    status, out, _ = call("drive.csv")
    assert status == 0 and "NOTE: slower than 1 km/h" in out
    status, out, _ = call("drive.csv", "--standstill", "0.5km/h")
    assert status == 0 and "207 samples in 4 stretches set to 0" in out and "NOTE" not in out
    status, out, err = call("route.vdri", "--standstill", "0.5km/h")
    assert status == 2 and "over distance; leave --standstill out" in err and not out
