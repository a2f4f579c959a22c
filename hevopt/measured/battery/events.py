"""What of a battery's test in time tells voltage and resistance: ends of rests, pulses, and steady current."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hevopt.display.facts import Shown
from hevopt.errors import DataError
from hevopt.measured.battery.samples import STEP, BatterySamples

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

# Share of the largest current below which a battery rests.
_REST = 0.02
# A rest of this length tells the open-circuit voltage, a load of this length a resistance.
_REST_S, _LOAD_S = 60.0, 2.0
# A longer load is no pulse: it is read at this many rows, evenly in charge, once its voltage has settled.
_PULSE_S, _STEADY_ROWS = 120.0, 40
# What passes within this time of a step is R0, where it is no more than this share of the pulse.
_AT_ONCE_S, _AT_ONCE = 1.0, 0.2


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class BatteryEvents(Shown):
    """Rows of the test that count.

    rest: (rest,) ends of rests; pulse: (pulse, 2) the row before it and its last; steady: (n,) under steady current
    jump: (n, 2) rows before and after a step of current; pulse_s: (pulse,) length; jump_s: (n,) between its rows
    drift_v: by how much the voltage still moved in the last quarter of the rest that drifts most
    """

    rest: Rows
    pulse: Rows
    steady: Rows
    jump: Rows
    pulse_s: Array
    jump_s: Array
    drift_v: float


def events_of(test: BatterySamples) -> BatteryEvents:
    """Rests, pulses and steady loads; DataError where the test has too few to tell a resistance."""
    time, current = test.time_s, test.current_a
    most = float(np.abs(current).max())
    resting = np.abs(current) <= _REST * most
    cuts = np.flatnonzero(
        (np.abs(np.diff(current)) > STEP * most) | (np.diff(resting.astype(int)) != 0)
    )
    first, last = np.concatenate([[0], cuts + 1]), np.concatenate([cuts, [len(time) - 1]])
    rest, pulse, steady, jump, drift = [], [], [], [], 0.0
    for n, (a, b) in enumerate(zip(first, last, strict=True)):
        length = float(time[b] - time[a])
        if resting[a]:
            if length >= _REST_S:
                rest.append(b)
                quarter = a + int(np.searchsorted(time[a : b + 1], time[b] - length / 4))
                drift = max(drift, abs(float(test.voltage_v[b] - test.voltage_v[quarter])))
            continue
        before = int(last[n - 1]) if n and resting[first[n - 1]] else None
        if before is not None and b > a:
            jump.append((before, a))
        if b + 1 < len(time) and resting[b + 1] and b > a:
            jump.append((b, b + 1))
        if before is not None and _LOAD_S <= length <= _PULSE_S:
            pulse.append((before, b))
        elif length > _PULSE_S:
            settled = np.flatnonzero(time[a : b + 1] >= time[a] + _PULSE_S / 2) + a
            picked = np.linspace(0, len(settled) - 1, min(len(settled), _STEADY_ROWS))
            steady += list(settled[np.round(picked).astype(np.int64)])
    pulses = np.array(pulse, dtype=np.int64).reshape(-1, 2)
    pulse_s = time[pulses[:, 1]] - time[pulses[:, 0]]
    jumps, jump_s = _at_once(test, jump, pulse_s)
    settled_rows = _without_pulses(test, steady, pulses)
    found = BatteryEvents(
        np.array(rest, dtype=np.int64), pulses, settled_rows, jumps, pulse_s, jump_s, drift
    )
    _check_enough(test, found)
    return found


def _at_once(
    test: BatterySamples, jump: list[tuple[int, int]], pulse_s: Array
) -> tuple[Rows, Array]:
    """The steps whose rows are close enough in time to tell R0 from what follows."""
    rows = np.array(jump, dtype=np.int64).reshape(-1, 2)
    apart = test.time_s[rows[:, 1]] - test.time_s[rows[:, 0]]
    most = min(_AT_ONCE_S, _AT_ONCE * float(pulse_s.min())) if len(pulse_s) else _AT_ONCE_S
    near = apart <= most + 1e-9
    return rows[near], apart[near]


def _without_pulses(test: BatterySamples, steady: list[int], pulses: Rows) -> Rows:
    """Rows under steady current of the directions that no pulse tells: a long load's resistance is another."""
    pulsed = {bool(test.current_a[row] > 0) for row in pulses[:, 1]}
    kept = [row for row in steady if bool(test.current_a[row] > 0) not in pulsed]
    return np.array(kept, dtype=np.int64)


def _check_enough(test: BatterySamples, found: BatteryEvents) -> None:
    if not len(found.pulse) and not len(found.steady):
        raise DataError(
            f"no load of {_LOAD_S:g} s or longer at steady current in this test; resistance is read from pulses "
            f"after a rest, or from constant current for more than {_PULSE_S:g} s"
        )
    steady = np.round(test.current_a[found.steady] / (STEP * np.abs(test.current_a).max()))
    if len(found.rest) < 2 and len(np.unique(steady)) < 2:
        raise DataError(
            f"{len(found.rest)} rests of {_REST_S:g} s or longer and one current only: open-circuit voltage and "
            "resistance cannot be told apart; add rests, or a run at another current or in the other direction to "
            "the same table"
        )
