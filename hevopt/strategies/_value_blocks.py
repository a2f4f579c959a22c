"""A value function over time, mode and stored energy in memory that grows with the square root of the steps.

Where the whole of it is small it is kept. Else only what follows each block of steps is kept, and a block is
computed again, to the same bits, when the rollout enters it: twice the time, save where the rollout turns back far.
"""

from collections.abc import Callable
from math import isqrt

from hevopt.problem.arrays import Array

# A table up to this size is kept whole.
_WHOLE_BYTES = 2**29


class ValueBlocks:
    """Cost-to-go by blocks of steps.

    backward: (first step, step after the last, cost-to-go after it) -> (step + 1, mode, node) cost-to-go
    terminal: (mode, node) cost-to-go after the last step
    """

    def __init__(
        self,
        steps: int,
        terminal: Array,
        backward: Callable[[int, int, Array], Array],
    ) -> None:
        whole = steps * terminal.nbytes <= _WHOLE_BYTES
        self._length = steps if whole else isqrt(steps) + 1
        self._steps, self._backward = steps, backward
        begins = range(0, steps, self._length)
        self._after = {begins[-1]: terminal}
        self._held: dict[int, Array] = {}
        for begin in reversed(begins):
            value = self._block(begin)
            if begin:
                self._after[begin - self._length] = value[0].copy()

    def block_of(self, step: int) -> tuple[int, Array]:
        """First step of the block that holds a step, and the block's (step + 1, mode, node) cost-to-go."""
        begin = step - step % self._length
        return begin, self._block(begin)

    def _block(self, begin: int) -> Array:
        """A block, and the one asked for before it is still held: a rollout may go back and forth between them."""
        if begin not in self._held:
            end = min(begin + self._length, self._steps)
            self._held = dict(list(self._held.items())[-1:])
            self._held[begin] = self._backward(begin, end, self._after[begin])
        return self._held[begin]
