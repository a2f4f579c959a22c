"""One round of guessing within a step: its row, and what its solution says of the guess. Compiled."""

from hevopt._compile import compiled
from hevopt.car._converter_kernels import passed
from hevopt.forward._rows_kernels import Array, Inputs, State, Ways, fill_row, lost_nm, turning
from hevopt.forward._solve_kernels import Flow, SolvedStep, directions, joint_torque_nm

# Share of a speed within which a moving ratio or a torque converter is settled, and of a torque within which what a
# map says is lost is.
SETTLED = 1e-13


@compiled(inline="always")
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


@compiled(bare=True)
def flow_of(
    ways: Ways, state: State, inputs: Inputs, ratio: float, wheel: float, gained_wheel: float, gained_side: float
) -> Flow:  # fmt: skip
    """A torque converter's torques at the mean speeds of a step, around guessed changes of speed: a Newton step.

    At those its loss is never negative, so that the step takes energy out, however long it is.
    ratio: of the clutch's output, at the step's end
    """
    if not inputs.flows or len(ways.fluid.pieces.speed_ratio) == 0:
        return Flow(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    output = len(ways.inertia_kgm2) - 1
    before = turning(ways.wheel, state.way, state.from_way, state.blend, output) * wheel
    turbine = 0.5 * (before + ratio * (wheel + gained_wheel))
    found = passed(ways.fluid.pieces, state.side_radps + 0.5 * gained_side, turbine)
    per_w, per_n = 0.5 * ratio, 0.5
    taken = (
        found.taken_nm
        - found.taken_per_t * per_w * gained_wheel
        - found.taken_per_p * per_n * gained_side
    )
    given = (
        found.given_nm
        - found.given_per_t * per_w * gained_wheel
        - found.given_per_p * per_n * gained_side
    )
    return Flow(taken, found.taken_per_t * per_w, found.taken_per_p * per_n, given, found.given_per_t * per_w,
                found.given_per_p * per_n)  # fmt: skip


@compiled(bare=True)
def flowing_nm(flow: Flow, solved: SolvedStep) -> tuple[float, float]:
    """What a torque converter takes and gives in a solution."""
    taken = flow.taken_nm + flow.taken_per_w * solved.wheel + flow.taken_per_n * solved.side
    given = flow.given_nm + flow.given_per_w * solved.wheel + flow.given_per_n * solved.side
    return taken, given


@compiled(bare=True)
def found_of(
    ways: Ways, row: Array, state: State, inputs: Inputs, variant: int, solved: SolvedStep, ratio: float,
    wheel: float, per_s: float, lost: float, given: float,
) -> tuple[int, float]:  # fmt: skip
    """The variant of a round's solution, and what a gearbox with a map loses with it.

    variant, lost: those that it was made with; ratio: of the clutch's output; given: by a torque converter there
    """
    mean_wheel = wheel + 0.5 * solved.wheel
    mean_side = state.side_radps + 0.5 * solved.side
    found = directions(row, ways.load.shape[2], variant, inputs.machine_nm, solved, mean_wheel, mean_side,
                       per_s, lost - given)  # fmt: skip
    if ways.lost.loss_nm.size > 0:
        through = joint_torque_nm(row, ways.lost.joint, inputs.machine_nm, solved, per_s, -given)
        lost = lost_nm(ways.lost, inputs.way, ratio * mean_wheel, through)
    return found, lost
