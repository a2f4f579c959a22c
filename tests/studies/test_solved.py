"""One strategy on one case: what it is told, and a failure that is its own."""

import numpy as np

from hevopt import compare, load_cycle
from hevopt.driving.cycle import Cycle


def test_sdp_on_other_steps_than_it_learns_from_fails_its_own_row():
    whole = load_cycle("nedc")
    time_s = np.arange(0.0, 100.0, 0.5)
    speed_mps = np.interp(time_s, whole.time_s, whole.speed_mps)
    cycle = Cycle("halves", time_s, speed_mps, 0 * speed_mps)
    rows = compare(cycle, "C2", ["sdp", "baseline"])
    assert [row.solved for row in rows.rows] == [False, True]
    (error,) = rows.failures.values()
    assert "cycle halves has steps of 0.5 to 0.5 s; resample it, or use a_ecms" in str(error)
