"""Where a coast-down ends: at its first speed of 0 or less, whatever the sensor shows after it."""

from pathlib import Path

import numpy as np
import pytest

from hevopt.errors import DataError
from hevopt.measured.coastdown.fit import fit_road_load
from hevopt.measured.coastdown.runs import read_runs

LOGS = Path(__file__).parents[1] / "logs"
# As tested, and what its wheels add.
MASS_KG = 1450.0 + 40.0


def fitted(path, **options):
    runs, notes = read_runs([path], {}, options.get("units", {}), options.get("directions"), None)
    return fit_road_load(runs, MASS_KG), notes


def test_the_sensors_last_samples_around_0_change_no_coefficient():
    clean, said = fitted(LOGS / "cd_clean.csv")
    tail, told = fitted(LOGS / "cd_neg_tail.csv")
    assert np.array_equal(clean.coefficients, tail.coefficients)
    assert np.array_equal(clean.half_width(), tail.half_width())
    assert clean.coefficients == pytest.approx([129.9, 2.02, 0.380], rel=5e-3)
    assert not any("run's end" in note for note in said)
    assert any("lines 100-101, 214-215, 314-315, 428-429" in note for note in told)


def text_of(change):
    """The clean runs, with each run's rows changed."""
    head, *rows = (LOGS / "cd_clean.csv").read_text().splitlines()
    runs = {}
    for row in rows:
        runs.setdefault(row.split(",")[0], []).append(row)
    return "\n".join([head, *(row for number in runs for row in change(runs[number]))])


def after(rows, speeds):
    """Rows of two more seconds each, with some speeds, behind a run."""
    run, direction, time, _ = rows[-1].split(",")
    return [f"{run},{direction},{float(time) + 2 * k},{v}" for k, v in enumerate(speeds, start=1)]


@pytest.mark.parametrize("speeds", [[0, 0, 0], [-0.3, 0.2, -0.1], ["0.0", "", ""], [0, 1.2, 0]])
def test_a_car_that_stands_has_ended_its_run(tmp_path, speeds):
    path = tmp_path / "a.csv"
    path.write_text(text_of(lambda rows: rows + after(rows, speeds)))
    assert np.array_equal(
        fitted(path)[0].coefficients, fitted(LOGS / "cd_clean.csv")[0].coefficients
    )


@pytest.mark.parametrize(
    ("change", "part"),
    [
        (
            lambda rows: rows + after(rows, [-0.1, 20, 40, 60, 80]),
            "speed is missing, negative or no number",
        ),
        (lambda rows: rows + after(rows, [0, 20, 40, 60, 80, 100]), "speed rises by"),
        (lambda rows: [*rows[:9], rows[9].rsplit(",", 1)[0] + ",-1", *rows[10:]], "negative"),
        (lambda rows: rows[:20] + after(rows[:20], [-1, -1]), "negative"),
        (lambda rows: [rows[0].rsplit(",", 1)[0] + ",", *rows[1:]], "speed is missing"),
    ],
)
def test_a_run_that_goes_on_and_a_sensor_that_drops_out_end_nothing(tmp_path, change, part):
    path = tmp_path / "a.csv"
    path.write_text(text_of(change))
    with pytest.raises(DataError, match=part):
        fitted(path)


def test_several_samples_in_a_clock_second_are_spread_in_coast_downs_too(tmp_path):
    time_s = np.arange(0, 120, 0.25)
    rows = [
        f"{run},{(-1) ** run},{int(t)},{120 - 0.8 * t - 0.01 * run * t:.4f}"
        for run in range(1, 5)
        for t in time_s
    ]
    path = tmp_path / "a.csv"
    path.write_text("\n".join(["run,direction,time [s],speed [km/h]", *rows]))
    fit, notes = fitted(path)
    assert any("up to 4 rows share each 1 s of the clock" in note for note in notes)
    # 0.8 to 0.84 km/h less a second.
    force, _ = fit.force_n(np.array([20.0]))
    assert force[0] == pytest.approx(MASS_KG * 0.825 / 3.6, rel=2e-3)


def test_a_coast_down_without_a_header_is_asked_for_everything_at_once(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("0,100\n1,99\n2,98\n")
    with pytest.raises(DataError) as error:
        fitted(path)
    message = str(error.value)
    assert "4 things are not in the file" in message
    for part in (
        "--column time=NAME",
        "--unit time=UNIT",
        "--column speed=NAME",
        "--unit speed=UNIT",
    ):
        assert part in message
