"""One round of guessing within a step: its row, and what its solution says of the guess. Compiled."""

from hevopt._compile import compiled
from hevopt.forward._rows_kernels import Array, Inputs, State, Ways, fill_row, lost_nm
from hevopt.forward._solve_kernels import SolvedStep, directions, joint_torque_nm

# Share of a speed within which a moving ratio is settled, and of a torque within which a map's loss is.
SETTLED = 1e-13


@compiled()
def row_of(
    ways: Ways, rows: Array, state: State, inputs: Inputs, variant: int, moving: bool, wheel: float,
    gained_wheel: float, gained_side: float, room: Array,
) -> Array:  # fmt: skip
    """The row of a variant: the settled one, or while a ratio moves that of guessed changes of speed, in `room`."""
    if not moving:
        settled: Array = rows[inputs.way, variant]
        return settled
    fill_row(ways, state, inputs, variant, wheel, wheel + gained_wheel,
             state.side_radps + gained_side, room)  # fmt: skip
    return room


@compiled()
def found_of(
    ways: Ways, row: Array, state: State, inputs: Inputs, variant: int, solved: SolvedStep, ratio: float,
    wheel: float, per_s: float, lost: float,
) -> tuple[int, float]:  # fmt: skip
    """The variant of a round's solution, and what a gearbox with a map loses with it.

    variant, lost: those that it was made with; ratio: of the clutch's output
    """
    mean_wheel = wheel + 0.5 * solved.wheel
    mean_side = state.side_radps + 0.5 * solved.side
    found = directions(row, ways.load.shape[2], variant, inputs.machine_nm, solved, mean_wheel, mean_side,
                       per_s, lost)  # fmt: skip
    if ways.lost.loss_nm.size > 0:
        through = joint_torque_nm(row, ways.lost.joint, inputs.machine_nm, solved, per_s, 0.0)
        lost = lost_nm(ways.lost, inputs.way, ratio * mean_wheel, through)
    return found, lost
