"""What a torque converter loses beside its lock-up clutch, and of that in launches."""

import numpy as np

from hevopt.forward import _drive_kernels as col
from hevopt.problem.arrays import Array


def converting(
    record: Array, before_mps: Array, side_radps: Array, turbine_radps: Array, idle_radps: float
) -> dict[str, Array]:
    """(step,) powers lost in all, in launches and else.

    before_mps: (step,) speed of the car before each step; side_radps, turbine_radps: mean speeds
    A launch is as a clutch's: the gears are slower than idle speed, nobody brakes, and the car gets no slower.
    """
    lost = record[:, col.IMPELLER] * side_radps - record[:, col.TURBINE] * turbine_radps
    launches = (turbine_radps < idle_radps) & (record[:, col.BRAKE] == 0)
    launches &= (record[:, col.SPEED] > 0) & (record[:, col.SPEED] >= before_mps)
    return {
        "torque_converter_loss_w": lost,
        "torque_converter_launch_w": np.where(launches, lost, 0.0),
        "torque_converter_other_w": np.where(launches, 0.0, lost),
    }
