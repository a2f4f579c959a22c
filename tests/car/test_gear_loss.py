"""Losses of a gearbox over speed and torque: where they rise as fast as the torque."""

import numpy as np
import pytest
from pydantic import ValidationError

from hevopt.car.gear_loss import too_steep
from hevopt.car_files.gearbox import GearLossFile

TORQUE = [-10.0, 0.0, 10.0, 30.0]


def test_a_loss_that_rises_as_fast_as_the_torque_is_found_with_its_place():
    gentle = np.array([[2.0, 1.0, 2.0, 4.0], [2.0, 1.0, 10.9, 30.8]])
    assert too_steep(np.array(TORQUE), gentle) is None
    steep = gentle.copy()
    steep[1, 3] = 40.9
    assert too_steep(np.array(TORQUE), steep) == (1, 10.0, 30.0, pytest.approx(1.5))
    # Exactly as fast is too fast: the output would not move.
    steep[1, 3] = 30.9
    assert too_steep(np.array(TORQUE), steep).rise == pytest.approx(1.0)


def test_what_was_not_measured_is_no_rise():
    holes = np.array([[np.nan, 1.0, np.nan, 40.0], [np.nan, 1.0, 2.0, np.nan]])
    assert too_steep(np.array(TORQUE), holes) is None


def test_a_file_with_such_a_loss_says_where():
    with pytest.raises(
        ValidationError, match=r"at 2000 rpm rises by 1\.5 Nm per Nm between 10 and 30 Nm"
    ):
        GearLossFile(
            speed_rpm=[1000.0, 2000.0],
            torque_nm=TORQUE,
            loss_nm=[[2.0, 1.0, 2.0, 4.0], [2.0, 1.0, 10.9, 40.9]],
        )
