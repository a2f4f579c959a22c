"""Shipped cycles against their regulations' figures, and the reader."""

import numpy as np
import pytest
from conftest import CYCLES

from hevopt import load_cycle
from hevopt.errors import DataError
from hevopt.files.lookup import shipped_names

# Duration s, distance km, top speed km/h. NEDC: UN R83, annex 4a. WLTC: UN GTR 15, annex 1. UDDS, FTP-75, US06:
# 40 CFR 86 appendix I; HWFET: 40 CFR 600 appendix I (7.45, 11.04, 8.01 and 10.26 miles).
# Artemis: Andre, Sci. Total Environ. 334-335 (2004): 993, 1082 and 1068 samples, one per second.
REGULATION = {
    "nedc": (1180, 11.03, 120.0),
    "wltc_class3b": (1800, 23.27, 131.3),
    "udds": (1369, 11.99, 91.25),
    "hwfet": (765, 16.51, 96.4),
    "us06": (600, 12.89, 129.2),
    "ftp75": (1874, 17.77, 91.25),
    "cadc_urban": (993, 4.87, 57.7),
    "cadc_road": (1081, 17.27, 111.5),
    "cadc_motorway130": (1067, 28.74, 131.8),
}


def test_every_shipped_cycle_is_checked():
    assert set(shipped_names("cycles", ".csv")) == set(REGULATION) == set(CYCLES)


@pytest.mark.parametrize("name", REGULATION)
def test_cycle_has_its_regulations_duration_distance_and_top_speed(name):
    cycle = load_cycle(name)
    duration_s, distance_km, top_kmh = REGULATION[name]
    assert cycle.duration_s == duration_s
    assert cycle.distance_m / 1e3 == pytest.approx(distance_km, abs=0.006)
    assert cycle.speed_mps.max() * 3.6 == pytest.approx(top_kmh, abs=0.06)
    assert cycle.speed_mps[0] == cycle.speed_mps[-1] == 0
    assert (np.diff(cycle.time_s) == 1).all()


def test_nedc_is_four_equal_urban_cycles_and_one_extra_urban():
    cycle = load_cycle("nedc")
    urban = [cycle.speed_mps[195 * n : 195 * n + 195] for n in range(4)]
    assert all(np.array_equal(urban[0], other) for other in urban[1:])
    # R83: an urban cycle has 1.013 km and 50 km/h, the extra-urban one 6.955 km and 400 s.
    assert np.sum(urban[0]) == pytest.approx(1013, abs=6)
    assert np.sum(cycle.speed_mps[780:]) == pytest.approx(6955, abs=25)
    assert max(urban[0]) * 3.6 == pytest.approx(50)


def test_nedc_engages_first_gear_before_each_of_its_13_launches():
    cycle = load_cycle("nedc")
    engaging = cycle.clutch_open & (cycle.gear == 1) & (cycle.speed_mps == 0)
    launches = np.flatnonzero((cycle.speed_mps[:-1] == 0) & (cycle.speed_mps[1:] > 0))
    assert len(launches) == 13
    assert all(engaging[k - 1] for k in launches[:-1])


def test_speed_units_of_columns_are_equivalent(tmp_path):
    speeds = {"speed_mps": 10.0, "speed_kmh": 36.0, "speed_mph": 10.0 / 0.44704}
    for column, value in speeds.items():
        path = tmp_path / f"{column}.csv"
        path.write_text(f"time_s,{column}\n0,0\n2,{value!r}\n4,0\n")
        assert load_cycle(path).speed_mps[1] == pytest.approx(10.0, rel=1e-12)


def test_a_byte_order_mark_and_comments_are_read_over(tmp_path):
    path = tmp_path / "bom.csv"
    path.write_text("\ufeff# made by hand\ntime_s,speed_mps\n0,0\n# middle\n1,2\n")
    assert load_cycle(path).distance_m == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("log.csv", "Time (sec);Speed\n0;1\n"),
        ("log.csv", "time_s,gear\n0,1\n"),
        ("log.xlsx", "PK"),
        ("log.mat", ""),
    ],
)
def test_a_log_in_place_of_a_cycle_file_is_sent_to_the_import(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    with pytest.raises(DataError, match="`hevopt cycles import FILE --out NAME"):
        load_cycle(tmp_path / name)


def test_a_grade_in_per_cent_is_told_what_it_should_be(tmp_path):
    (tmp_path / "hill.csv").write_text("time_s,speed_mps,grade\n0,0,5\n1,2,5\n")
    with pytest.raises(
        DataError, match=r"grade is 5; allowed: -0.5 to 0.5, rise over run: 5 % is 0.05"
    ):
        load_cycle(tmp_path / "hill.csv")
