"""Rollout: the path that follows a value function and can always still reach the end.

Shared by every strategy that looks ahead. The value function is linear between the nodes of an energy grid;
two nodes make it a plain price on stored energy.
"""

from collections.abc import Callable

import numpy as np

from hevopt.errors import EndChargeError, InfeasibleError, SolverError
from hevopt.problem import battery as battery_model
from hevopt.problem._battery_kernels import chemical_power_at
from hevopt.problem.arrays import Array, Indices
from hevopt.problem.choices import Choices, choices_of
from hevopt.problem.once import once
from hevopt.problem.problem import Problem
from hevopt.strategies import _rollout_kernels as kernels
from hevopt.strategies._reach_kernels import Reach, reachable
from hevopt.strategies._rollout_kernels import Grid

# Moves per step before the search for a way round dead ends is given up.
_MOVES_PER_STEP = 500


def reach_of(problem: Problem, end_min_j: float) -> Reach:
    """From where an end charge can be reached; InfeasibleError where the start is not among it."""
    choices, known = choices_of(problem), _reaches(problem.origin)
    if end_min_j not in known:
        known[end_min_j] = reachable(choices, problem.window_j, end_min_j, problem.battery.arrays)
    reach = known[end_min_j]
    mode, slack = problem.start_mode, 1e-12 * problem.window_j[1]
    least, greatest = reach.least_j[0, mode], reach.greatest_j[0, mode]
    if not least - slack <= problem.start_j <= greatest + slack:
        raise _why_unreachable(problem, choices, end_min_j)
    return reach


@once
def _reaches(problem: Problem) -> dict[float, Reach]:
    """End charge -> from where it can be reached, which no cost changes."""
    return {}


def roll(
    problem: Problem,
    choices: Choices,
    reach: Reach,
    value_kg: Array,
    grid: Grid,
) -> tuple[Indices, Array]:
    """Entries (time,) that follow a value function (time + 1, mode, node), and stored energy (time + 1,)."""
    return follow(problem, choices, reach, lambda step: (0, value_kg), grid)


def follow(
    problem: Problem,
    choices: Choices,
    reach: Reach,
    block_of: Callable[[int], tuple[int, Array]],
    grid: Grid,
) -> tuple[Indices, Array]:
    """As `roll`, with a value function that comes by blocks.

    block_of: step -> first step of its block, and (step + 1, mode, node) values from there on
    """
    steps, budget = choices.steps, _MOVES_PER_STEP * choices.steps + 10_000
    progress = kernels.Course(
        np.full(steps, -1), np.empty(steps + 1), np.empty(steps + 1, dtype=np.int64),
        np.zeros(len(choices.cost_kg), dtype=bool), np.zeros(3, dtype=np.int64),
        np.empty(len(choices.cost_kg)), np.empty(len(choices.cost_kg)),
    )  # fmt: skip
    battery = problem.battery.arrays
    progress.energy[0], progress.mode[0] = problem.start_j, problem.start_mode
    while 0 <= progress.at[0] < steps and progress.at[2] < budget:
        begin, value_kg = block_of(int(progress.at[0]))
        kernels.rollout(choices, begin, value_kg, grid, reach, battery, progress, budget)
    reached, furthest, moves = progress.at
    if reached == steps:
        return progress.path, progress.energy
    where = f"step {furthest} (t = {problem.table.time_s[furthest]:g} s)"
    if moves < budget:
        raise InfeasibleError(
            f"no path reaches the end: every way stops at {where} at the latest; widen the SOC window, "
            "ask for a lower soc_end or allow more switches"
        )
    raise SolverError(
        f"rollout: no way found past {where} within {budget} moves; use a finer energy grid"
    )


def _why_unreachable(problem: Problem, choices: Choices, end_min_j: float) -> InfeasibleError:
    """The error with the first step at which nothing is left, and why, going forward from the start."""
    low, high = problem.window_j
    bottom = np.full(choices.modes, np.inf)
    top = np.full(choices.modes, -np.inf)
    bottom[problem.start_mode] = top[problem.start_mode] = problem.start_j
    for k in range(choices.steps):
        moved = _advance(problem, choices, k, bottom, top)
        if not (moved[0] <= moved[1]).any():
            return InfeasibleError(_reason_at(problem, choices, k))
        bottom, top = np.maximum(moved[0], low), np.minimum(moved[1], high)
        gone = bottom > top
        bottom, top = np.where(gone, np.inf, bottom), np.where(gone, -np.inf, top)
        if gone.all():
            return InfeasibleError(_reason_at(problem, choices, k))
    best = float(battery_model.soc(problem.battery, top.max()))
    wanted = float(battery_model.soc(problem.battery, end_min_j))
    if top.max() >= end_min_j:
        lowest, highest = (float(battery_model.soc(problem.battery, e)) for e in problem.window_j)
        return InfeasibleError(
            f"no path was found that keeps within the SOC window {lowest:.6g} to {highest:.6g} and ends at SOC "
            f"{wanted:.6g} or above, though each step alone allows one: steps move about as much as the window "
            "holds; widen it, or ask for a lower soc_end"
        )
    return EndChargeError(
        f"the end charge cannot be reached: SOC {wanted:.4f} is asked, {best:.4f} is the most any plan "
        f"reaches at the last step {choices.steps - 1}; ask for a lower soc_end or give the machine more power",
        best,
    )


def _advance(
    problem: Problem, choices: Choices, k: int, bottom: Array, top: Array
) -> tuple[Array, Array]:
    """Least and greatest energy per mode after step k."""
    new_bottom, new_top = np.full_like(bottom, np.inf), np.full_like(top, -np.inf)
    switching, (low, high) = choices.switching, problem.window_j
    case = switching.case[k]
    for n in range(choices.modes):
        entries = slice(choices.first[k, n], choices.first[k, n + 1])
        power = choices.power_w[entries]
        taken_j = switching.energy_j[case, :, n]
        floor, ceiling = np.maximum(bottom - taken_j, low), np.minimum(top - taken_j, high)
        origins = switching.allowed[case, :, n] & np.isfinite(bottom) & (floor <= ceiling)
        if not len(power) or not origins.any():
            continue
        for energy, pick in (
            (floor[origins].min(), power.max()),
            (ceiling[origins].max(), power.min()),
        ):
            drain = chemical_power_at(pick, energy, problem.battery.arrays)
            after = energy - choices.step_s[k] * drain
            new_bottom[n], new_top[n] = min(new_bottom[n], after), max(new_top[n], after)
    return new_bottom, new_top


def _reason_at(problem: Problem, choices: Choices, k: int) -> str:
    place = f"nothing is reachable after step {k} (t = {problem.table.time_s[k]:g} s)"
    if choices.first[k, 0] == choices.first[k, -1]:
        return f"{place}: every control is rejected there; see the table's reject"
    entries = slice(choices.first[k, 0], choices.first[k, -1])
    power = choices.power_w[entries]
    return (
        f"{place}: the allowed controls leave the SOC window {problem.battery.soc_min:g} to "
        f"{problem.battery.soc_max:g} or need a forbidden switch (battery power {power.min():.0f} to "
        f"{power.max():.0f} W); widen the window, or allow the switch"
    )
