"""Figures of SAE J2951 against hand calculation, and the tolerance of a trace."""

import numpy as np
import pytest

from hevopt import load_architecture
from hevopt.forward.quality import _highest, drive_quality, violations

TIME_S = np.arange(0.0, 60.05, 0.1)


@pytest.fixture(scope="module")
def vehicle():
    return load_architecture("A").vehicle


def ramp(top_mps, rise_s=20.0):
    """Up for some time, constant, down the same way."""
    return (
        np.minimum(np.clip(TIME_S / rise_s, 0, 1), np.clip((60 - TIME_S) / rise_s, 0, 1)) * top_mps
    )


def test_a_trace_driven_exactly_has_only_zeros(vehicle):
    quality = drive_quality(vehicle, TIME_S, ramp(15), ramp(15))
    assert quality.energy_percent == quality.distance_percent == quality.speed_error_mps == 0
    assert quality.speed_change_percent == quality.inertial_work_percent == 0
    assert quality.violations == ()


def test_one_tenth_faster_changes_distance_by_ten_and_inertial_work_by_21_per_cent(vehicle):
    quality = drive_quality(vehicle, TIME_S, 1.1 * ramp(15), ramp(15))
    assert quality.distance_percent == pytest.approx(10, abs=0.01)
    assert quality.speed_change_percent == pytest.approx(10, abs=0.01)
    assert quality.inertial_work_percent == pytest.approx(21, abs=0.02)
    assert 10 < quality.energy_percent < 21
    energy, distance = 1 + quality.energy_percent / 100, 1 + quality.distance_percent / 100
    assert quality.energy_economy_percent == pytest.approx(100 * (1 - distance / energy))


def test_cycle_energy_of_a_constant_speed_is_that_of_its_road_load(vehicle):
    fast, slow = np.full_like(TIME_S, 20.0), np.full_like(TIME_S, 19.0)
    quality = drive_quality(vehicle, TIME_S, fast, slow)
    r0, r1, _, _ = vehicle.rolling_n
    drag = vehicle.air_n[2]
    wanted = (r0 + r1 * 19 + drag * 19**2) * 19
    driven = (r0 + r1 * 20 + drag * 20**2) * 20
    assert quality.energy_percent == pytest.approx(100 * (driven / wanted - 1), rel=1e-9)
    assert quality.speed_error_mps == pytest.approx(1, rel=1e-9)


def test_speed_error_is_the_root_of_the_mean_square_of_the_smoothed_difference(vehicle):
    """An error of ±0.5 m/s over blocks of 5 s, which smoothing over 0.9 s leaves but at the edges."""
    error = 0.5 * np.sign(np.sin(2 * np.pi * (TIME_S + 1e-6) / 10))
    wanted = np.full_like(TIME_S, 20.0)
    quality = drive_quality(vehicle, TIME_S, wanted + error, wanted)
    assert 0.93 * 0.5 < quality.speed_error_mps < 0.5


def test_speeds_up_to_three_hundredths_of_a_metre_per_second_are_standstill(vehicle):
    crawling = np.where(TIME_S < 30, ramp(15), 0.02)
    standing = np.where(TIME_S < 30, ramp(15), 0.0)
    quality = drive_quality(vehicle, TIME_S, crawling, standing)
    assert abs(quality.distance_percent) < 1e-2


def test_a_trace_one_second_late_is_within_the_tolerance(vehicle):
    late = np.interp(TIME_S - 0.99, TIME_S, ramp(15, 10))
    assert drive_quality(vehicle, TIME_S, late, ramp(15, 10)).violations == ()


def test_a_violation_is_told_with_its_start_length_and_depth():
    wanted = np.full_like(TIME_S, 20.0)
    driven = wanted.copy()
    driven[(TIME_S > 9.95) & (TIME_S < 12.95)] = 19.0  # 30 samples, 1 m/s low
    driven[TIME_S > 59.95] = 21.0
    first, last = violations(TIME_S, driven, wanted, 2 / 3.6, 1.0)
    assert (first.start_s, first.duration_s) == pytest.approx((10, 3))
    assert (first.beyond_mps, last.beyond_mps) == pytest.approx((1 - 2 / 3.6,) * 2)
    assert (last.start_s, last.duration_s) == pytest.approx((60, 0.1))


def test_the_tolerance_follows_the_highest_and_lowest_of_two_seconds():
    """Beside a jump from 0 to 10 m/s everything between is allowed, up to a second away from it."""
    wanted = np.where(TIME_S < 30, 0.0, 10.0)
    driven = np.where(np.abs(TIME_S - 30) < 0.95, 5.0, wanted)
    assert violations(TIME_S, driven, wanted, 2 / 3.6, 1.0) == ()
    wider = np.where(np.abs(TIME_S - 30) < 1.55, 5.0, wanted)
    before, after = violations(TIME_S, wider, wanted, 2 / 3.6, 1.0)
    assert before.duration_s == pytest.approx(0.5, abs=0.11)
    assert after.duration_s == pytest.approx(0.5, abs=0.11)


def test_a_wanted_trace_that_stands_still_has_no_ratings(vehicle):
    quality = drive_quality(vehicle, TIME_S, 0 * TIME_S, 0 * TIME_S)
    assert np.isnan(quality.energy_percent) and quality.violations == ()


@pytest.mark.parametrize("count", [1, 2, 5, 21])
def test_the_highest_of_neighbours_is_found_by_halves(count):
    values = np.random.default_rng(count).uniform(size=40)
    brute = [values[first : first + count].max() for first in range(40 - count + 1)]
    assert _highest(values, count).tolist() == brute
