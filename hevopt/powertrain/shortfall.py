"""The message about steps that the car cannot follow: time, speed, missing torque, reasons, and what to do."""

import numpy as np
from numpy.typing import NDArray

from hevopt.car.architecture import Architecture
from hevopt.driving.demand import Demand
from hevopt.problem.arrays import Array, Flags
from hevopt.problem.reject import REJECT_WORDS, Reject

Bits = NDArray[np.uint16]
_LISTED = 12


def shortfall_message(
    architecture: Architecture,
    demand: Demand,
    stuck: Flags,
    missing: Array,
    reject: Bits,
) -> str:
    """Which steps cannot be followed and what is missing; reject: (time, control).

    stuck: (time,) steps without any control; missing: (time,) torque that lacks at the wheels, Nm
    """
    steps = np.flatnonzero(stuck)
    lines = []

    def gear(k: int) -> str:
        return f"gear {demand.gear[k]}, " if architecture.gearbox is not None else ""

    for k in steps[:_LISTED]:
        counts = {word: int(np.sum(reject[k] & bit > 0)) for bit, word in REJECT_WORDS.items()}
        reasons = ", ".join(f"{word} {count}" for word, count in counts.items() if count)
        torque = f", {missing[k]:.0f} Nm missing at the wheels" if missing[k] > 0 else ""
        lines.append(
            f"t = {demand.time_s[k]:g} s: {demand.speed_mps[k] * 3.6:.1f} km/h, {gear(k)}"
            f"{demand.wheel_power_w[k] / 1e3:.1f} kW at the wheels"
            f"{torque} (of {reject.shape[1]} controls rejected: {reasons})"
        )
    more = len(steps) - len(lines)
    lines += [f"and {more} more"] if more else []
    neutral = stuck & (demand.gear == 0) & (demand.wheel_torque_nm > 0)
    neutral &= architecture.gearbox is not None
    return (
        f"architecture {architecture.name} cannot follow the cycle at {len(steps)} of "
        f"{len(stuck)} steps:\n  " + "\n  ".join(lines + _advice(neutral, stuck, missing, reject))
    )


def _advice(neutral: Flags, stuck: Flags, missing: Array, reject: Bits) -> list[str]:
    """What to do, by what is wrong: the cycle's gear, too little torque, or a limit."""
    weak, limited = stuck & ~neutral & (missing > 0), stuck & ~neutral & (missing == 0)
    advice = []
    if neutral.any():
        advice.append(
            "correct the cycle's gear column: in gear 0 the engine cannot drive the wheels"
        )
    if weak.any():
        advice.append(
            "choose an easier cycle, a stronger engine (full_load in its file) or lower gears, or pass "
            "--allow-shortfall to drive on with what there is"
        )
    if limited.any():
        counts = {w: int(np.sum(reject[limited] & bit > 0)) for bit, w in REJECT_WORDS.items()}
        del counts[REJECT_WORDS[Reject.DUPLICATE]]
        most = max(counts, key=lambda words: counts[words])
        advice.append(
            f"where no torque is missing, most controls are rejected for: {most}; "
            "widen that limit in its component's file, or choose an easier cycle"
        )
    return advice
