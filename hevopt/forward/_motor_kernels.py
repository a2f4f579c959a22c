"""Engine at rest, started, turning, stopped; and the clutch between it and the gears. Compiled."""

from typing import NamedTuple

from hevopt._compile import compiled
from hevopt.car.handling import Clutch
from hevopt.forward._contact_kernels import clutch_capacity_nm
from hevopt.forward._limits_kernels import Limits, launch_radps

REST, STARTING, TURNING, STOPPING = 0, 1, 2, 3
# Why the clutch slips: it does not, a launch, a change of gear or another opening, a start of the engine.
NONE, LAUNCH, CHANGE, START = 0, 1, 2, 3
# Braking, the clutch is opened this close to idle speed.
_OPENS_AT = 1.02
_CLOSED_SLIP_RADPS = 1.0


class Joined(NamedTuple):
    """The engine's phase and the clutch: closing from 0 to 1, whether it launches the car, why it slips.

    flows: whether a torque converter passes torque, of which the clutch locks up
    """

    phase: int
    closing: float
    launches: bool
    cause: int
    launch_radps: float
    flows: bool = False


@compiled(bare=True)
def phase_after(phase: int, on: bool, side_radps: float, idle_radps: float) -> int:
    """The phase of a step, in which the engine is wanted turning or not."""
    if on:
        if phase == TURNING or (phase == STARTING and side_radps >= idle_radps * (1 - 1e-9)):
            return TURNING
        return STARTING
    if phase == REST or side_radps <= 0.0:
        return REST
    return STOPPING


@compiled(bare=True)
def joined(
    before: Joined,
    phase: int,
    apart: bool,
    neutral: bool,
    braking: bool,
    input_radps: float,
    need_nm: float,
    limits: Limits,
    clutch: Clutch,
    step_s: float,
) -> Joined:
    """The clutch of a step.

    apart: a change of gear holds it open; neutral: so does the cycle
    need_nm: torque at the clutch that the driver asks for
    """
    if phase != TURNING:
        cause = START if phase == STARTING else NONE
        return Joined(phase, 0.0, False, cause, limits.idle_radps, False)
    if apart:
        return Joined(phase, 0.0, False, CHANGE, limits.idle_radps, False)
    if neutral or (braking and input_radps < _OPENS_AT * limits.idle_radps):
        return Joined(phase, 0.0, False, before.cause, limits.idle_radps, False)
    launch = launch_radps(need_nm, limits) if need_nm > 0.0 else limits.idle_radps
    launch = max(launch, before.launch_radps) if before.launches else launch
    # It begins where the gears are slower than idle speed; above that the clutch closes, however much is asked for.
    begins_below = launch if before.launches else limits.idle_radps
    if not braking and input_radps < begins_below:
        return Joined(phase, 0.0, True, LAUNCH, launch, False)
    if before.launches:
        return Joined(phase, 1.0, False, LAUNCH, limits.idle_radps, False)
    cause = before.cause if before.closing < 1.0 else NONE
    return Joined(phase, _closing(before, clutch, step_s), False, cause, limits.idle_radps, False)


@compiled(bare=True)
def locked_up(
    before: Joined, phase: int, apart: bool, neutral: bool, locks: bool, limits: Limits, clutch: Clutch,
    step_s: float,
) -> Joined:  # fmt: skip
    """The lock-up clutch of a step, and whether the torque converter beside it passes torque.

    apart: a change of gear interrupts both; neutral: so does the cycle, or a car that is held
    locks: speed and gear are those in which the clutch closes
    """
    if phase != TURNING or apart or neutral:
        return Joined(phase, 0.0, False, NONE, limits.idle_radps, False)
    if not locks:
        return Joined(phase, 0.0, False, NONE, limits.idle_radps, True)
    return Joined(phase, _closing(before, clutch, step_s), False, CHANGE, limits.idle_radps, True)


@compiled(bare=True)
def _closing(before: Joined, clutch: Clutch, step_s: float) -> float:
    return 1.0 if clutch.closing_s <= 0 else min(before.closing + step_s / clutch.closing_s, 1.0)


@compiled(bare=True)
def capacity_nm(joint: Joined, need_nm: float, slip_radps: float, clutch: Clutch) -> float:
    """The clutch's torque at most: all it has while it closes, what is asked for in a launch."""
    highest = clutch_capacity_nm(slip_radps, clutch)
    if joint.launches:
        return min(need_nm, highest)
    return joint.closing * highest
