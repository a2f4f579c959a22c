"""The gear command: when a change begins, the gap in torque, and the ratio that follows with a lag. Compiled."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hevopt._compile import compiled
from hevopt.car.handling import Shifting
from hevopt.forward._rows_kernels import Array, State, Ways, turning

# Share of a ratio's change that is left where it is done.
_DONE = 1e-3
# A coupling that opened at high speed closes again below this share of it.
_CLOSES_AGAIN = 0.98
_NEVER_S = 1e9
_ROUNDING_S = 1e-9


class Lever(NamedTuple):
    """Where a change of gear stands: units turn as in `way`, by the share `blend` still as in `from_way`.

    gap_s: time left without torque through the clutch; since_s: since the last change began; back: the way before
    """

    way: int
    from_way: int
    blend: float
    gap_s: float
    since_s: float
    back: int


@compiled(bare=True)
def resting_lever(way: int) -> Lever:
    """No change under way."""
    return Lever(way, way, 0.0, 0.0, _NEVER_S, -1)


@compiled(inline="always")
def moves_machine(ways: Ways, lever: Lever) -> bool:
    """Whether the machine's gear is part of the change under way."""
    differs = ways.wheel[lever.way, 1] != ways.wheel[lever.from_way, 1]
    return differs and (lever.blend > 0.0 or lever.gap_s > 0.0)


@compiled(bare=True)
def changed(
    lever: Lever,
    asked: int,
    wheel_radps: float,
    ways: Ways,
    fast_way: NDArray[np.int64],
    fast_radps: Array,
    shifting: Shifting,
    step_s: float,
    machine_nm: float,
) -> Lever:
    """The lever after a step in which a way is asked for; machine_nm: what its machine may use to keep pace."""
    wanted = asked
    again = _CLOSES_AGAIN if lever.way == fast_way[asked] else 1.0
    if wheel_radps >= again * fast_radps[asked]:
        wanted = fast_way[asked]
    left_s, since_s = lever.gap_s - step_s, lever.since_s + step_s
    gap_s = left_s if left_s > _ROUNDING_S else 0.0
    output = len(ways.inertia_kgm2) - 1
    if wanted != lever.way and lever.blend == 0.0 and gap_s == 0.0:
        if wheel_radps == 0.0:
            return Lever(wanted, wanted, 0.0, 0.0, _NEVER_S, -1)
        ratio, now = ways.wheel[wanted, output], ways.wheel[lever.way, output]
        if ratio == now:
            return _followed(
                Lever(wanted, lever.way, 1.0, 0.0, since_s, lever.back),
                wheel_radps, ways, shifting, step_s, machine_nm,
            )  # fmt: skip
        back = wanted == lever.back and ratio < now
        if since_s >= (shifting.reversal_s if back else shifting.between_s):
            return _followed(
                Lever(wanted, lever.way, 1.0, shifting.gap_s, 0.0, lever.way),
                wheel_radps, ways, shifting, step_s, machine_nm,
            )  # fmt: skip
    on = Lever(lever.way, lever.from_way, lever.blend, gap_s, since_s, lever.back)
    return _followed(on, wheel_radps, ways, shifting, step_s, machine_nm)


@compiled(bare=True)
def _followed(
    lever: Lever,
    wheel_radps: float,
    ways: Ways,
    shifting: Shifting,
    step_s: float,
    machine_nm: float,
) -> Lever:
    """The ratio's lag, no faster than the machine can bring its rotor along."""
    if lever.blend == 0.0:
        return lever
    lag = shifting.ratio_lag_s
    blend = lever.blend * np.exp(-step_s / lag) if lag > 0.0 else 0.0
    if blend < _DONE:
        blend = 0.0
    if len(ways.inertia_kgm2) > 2:
        apart = abs(ways.wheel[lever.from_way, 1] - ways.wheel[lever.way, 1])
        momentum = ways.inertia_kgm2[1] * apart * wheel_radps
        if momentum > 0.0:
            blend = max(blend, lever.blend - machine_nm * step_s / momentum)
    return Lever(lever.way, lever.from_way, blend, lever.gap_s, lever.since_s, lever.back)


@compiled(inline="always")
def keeping_pace_nm(
    ways: Ways, state: State, lever: Lever, wheel_radps: float, step_s: float
) -> float:
    """The machine's torque that turns its own rotor along with its moving ratio."""
    before = turning(ways.wheel, state.way, state.from_way, state.blend, 1)
    after = turning(ways.wheel, lever.way, lever.from_way, lever.blend, 1)
    return ways.inertia_kgm2[1] * (after - before) * wheel_radps / step_s
