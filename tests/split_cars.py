"""What tests of drivelines with several machines share: parts of cycles, losses by the files in plain numbers."""

import tomllib
from dataclasses import replace

from hevopt import load_cycle
from hevopt.driving.cycle import Cycle
from hevopt.files.lookup import shipped_folder


def short(cycle: str, seconds: int) -> Cycle:
    """The first part of a shipped cycle."""
    whole, end = load_cycle(cycle), seconds + 1
    return replace(
        whole, time_s=whole.time_s[:end], speed_mps=whole.speed_mps[:end], grade=whole.grade[:end]
    )


def table_value(machine: str, rpm: float, nm: float) -> float:
    """Loss of a machine by its file, bilinear, in plain numbers."""
    path = shipped_folder("architectures") / "components" / f"{machine}.toml"
    grid = tomllib.loads(path.read_text())["loss_map"]
    speeds, torques = grid["speed_rpm"], grid["torque_nm"]
    i = max(n for n in range(len(speeds) - 1) if speeds[n] <= rpm)
    j = max(n for n in range(len(torques) - 1) if torques[n] <= nm)
    x = (rpm - speeds[i]) / (speeds[i + 1] - speeds[i])
    y = (nm - torques[j]) / (torques[j + 1] - torques[j])
    corner = grid["loss_w"]
    low = corner[i][j] * (1 - y) + corner[i][j + 1] * y
    high = corner[i + 1][j] * (1 - y) + corner[i + 1][j + 1] * y
    return low * (1 - x) + high * x
