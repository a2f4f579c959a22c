"""State of charge of a battery's test: by its column, or counted from the charge that passes; and the capacity."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from hevopt.errors import DataError
from hevopt.measured.tables.table import Measured

Array = NDArray[np.float64]

# A longer step, in seconds and in usual steps, parts two runs.
_GAP_S, _GAP_STEPS = 60.0, 20.0
# By how much, as a share, a column of charge may differ from the current's integral.
_CHARGE_OFF = 0.1


def near_steps(time_s: Array) -> NDArray[np.bool_]:
    """(row - 1,) steps that are no gap between one run and the next."""
    steps = np.diff(time_s)
    near: NDArray[np.bool_] = steps <= max(_GAP_S, _GAP_STEPS * float(np.median(steps)))
    return near


def passed_as(time_s: Array, current: Array) -> Array:
    """(row,) charge that has passed since the first row, As."""
    steps = np.diff(time_s) * (current[1:] + current[:-1]) / 2
    return np.concatenate([[0.0], np.cumsum(steps)])


def soc_and_capacity(
    measured: Measured, values: Mapping[str, Array], current: Array, start_soc: float | None,
    capacity_ah: float | None, notes: list[str],
) -> tuple[Array, float]:  # fmt: skip
    """(row,) state of charge, and the capacity in As."""
    drawn = passed_as(values["time"], current)
    if "soc" in values:
        if start_soc is not None:
            raise DataError(f"{measured.path}: both a column of soc and --start-soc; leave one out")
        near = near_steps(values["time"])
        return values["soc"], _capacity(measured, values["soc"], drawn, near, capacity_ah, notes)
    missing = [
        option
        for option, given in (("--start-soc", start_soc), ("--set capacity_ah=VALUE", capacity_ah))
        if given is None
    ]
    if missing:
        raise DataError(
            f"{measured.path}: no column of soc found; name it with --column soc=NAME, or give "
            f"{' and '.join(missing)}, from which it is counted"
        )
    assert start_soc is not None and capacity_ah is not None
    if not 0 <= start_soc <= 1:
        raise DataError(f"--start-soc {start_soc:g}; allowed: 0 to 1, which is 100 %")
    what = "the current's integral"
    if "charge" in values:
        drawn, what = _counted(measured, values["charge"], drawn), "the column of charge"
    soc = start_soc - drawn / (capacity_ah * 3600)
    if soc.min() < -0.02 or soc.max() > 1.02:
        raise DataError(
            f"{measured.path}: by {what} the state of charge goes from {soc.max():.3g} to {soc.min():.3g}, beyond "
            f"0 to 1; check --start-soc {start_soc:g}, capacity_ah {capacity_ah:g} and the sensor's offset"
        )
    notes.append(f"soc: {start_soc:g} at the first row, then by {what} over {capacity_ah:g} Ah")
    return np.clip(soc, 0.0, 1.0), capacity_ah * 3600


def _counted(measured: Measured, charge: Array, drawn: Array) -> Array:
    """Charge drawn since the first row by its column, whichever sign it has; DataError where it starts anew."""
    steps, flow = np.diff(charge), np.diff(drawn)
    steps = steps * (1.0 if np.sum(steps * flow) >= 0 else -1.0)
    if np.abs(steps - flow).sum() > _CHARGE_OFF * np.abs(flow).sum():
        raise DataError(
            f"{measured.path}: the column of charge does not follow the current's integral ("
            f"{steps.sum() / 3600:.4g} against {flow.sum() / 3600:.4g} Ah), as one does that starts anew at every "
            "step; leave it out, or name another with --column charge=NAME"
        )
    return np.concatenate([[0.0], np.cumsum(steps)])


def _capacity(
    measured: Measured, soc: Array, drawn: Array, near: NDArray[np.bool_], capacity_ah: float | None,
    notes: list[str],
) -> float:  # fmt: skip
    """As that a full battery holds: as given, else what of the current moves the column of soc, gaps left out."""
    fallen, passed = (
        np.cumsum(np.where(near, np.diff(v), 0.0)) for v in (-soc, drawn)
    )  # fmt: skip
    fallen, passed = fallen - fallen.mean(), passed - passed.mean()
    spread = float(np.sum(fallen**2))
    found = float(np.sum(passed * fallen)) / spread if spread > 0 else 0.0
    if capacity_ah is not None:
        if found > 0 and abs(found / 3600 / capacity_ah - 1) > _CHARGE_OFF:
            notes.append(
                f"WARNING: current and soc give a capacity of {found / 3600:.4g} Ah, not {capacity_ah:g} as given"
            )
        return capacity_ah * 3600
    if found <= 0 or np.ptp(soc) < 0.1:
        raise DataError(
            f"{measured.path}: the capacity cannot be told from current and soc, which moves by {np.ptp(soc):.3g}; "
            "give --set capacity_ah=VALUE"
        )
    notes.append(f"capacity: {found / 3600:.4g} Ah, by which the current moves the column of soc")
    return found
