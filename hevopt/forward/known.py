"""Whether fuel and charge of driven steps are known: where maps or the battery have ended they are not."""

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.errors import DataError
from hevopt.forward.books import Books, within_top
from hevopt.forward.run import check_charge
from hevopt.problem.arrays import Array


def check_known(car: Architecture, books: Books, record: Array, time_s: Array) -> None:
    """DataError where a measured map or the battery has ended, so that fuel or charge is not known."""
    flows = books.flows
    ended = {"engine": np.isnan(flows["fuel_power_w"] + flows["nox_kgps"])}
    if np.isnan(flows["machine_loss_w"]).any():
        for (name, _), machine in zip(car.driveline.machines, car.machines, strict=True):
            speed = within_top(machine, flows[f"{name}_speed_radps"])
            ended[name] = np.isnan(machine.loss_w(flows[f"{name}_torque_nm"], speed))
    for name, unknown in ended.items():
        torque, speed = flows[f"{name}_torque_nm"], flows[f"{name}_speed_radps"]
        if (off := unknown & np.isfinite(torque) & np.isfinite(speed)).any():
            n = int(np.argmax(off))
            raise DataError(
                f"{car.name}: the map of its {name} has no data at t = {time_s[n]:g} s, {speed[n]:.1f} rad/s and "
                f"{torque[n]:.1f} Nm; ask for less or another gear, or extend the map"
            )
    check_charge(car, books, record, time_s)
    if not (np.isfinite(record).all() and np.isfinite(books.energy_j).all()):
        raise DataError(
            f"{car.name}: more is asked at t = {time_s[0]:g} s than battery and machines can do; ask for less"
        )
