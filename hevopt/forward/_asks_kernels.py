"""How a compiled loop asks whoever decides: by the address of a function that is told the number of a decision.

What is told and what is answered lies in arrays that both know, so that nothing is packed or unpacked on the way.
"""

import ctypes
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic, overload
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Whoever is asked: the number of a decision -> 0, or anything else where the loop shall end.
Asked = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64)


class Asks(NamedTuple):
    """Who is asked as each step of a plan begins, and what is told.

    address: of an `Asked`, 0 for nobody; for_s: time for which a decision holds
    last: (1,) number of the last decision; told: (3,) speed, torque at the wheels that the driver asks for, and
    stored energy, filled
    """

    address: int
    for_s: float
    last: NDArray[np.int64]
    told: Array


NOBODY = Asks(0, 0.0, np.zeros(1, dtype=np.int64), np.zeros(3))


def answered(address: int, decision: int) -> int:
    """What an `Asked` at an address answers."""
    return int(Asked(address)(decision))


@intrinsic  # type: ignore[untyped-decorator]
def _called(context: Any, address: Any, decision: Any) -> Any:
    def generated(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        whole = ir.IntType(64)
        pointer = builder.inttoptr(args[0], ir.FunctionType(whole, [whole]).as_pointer())
        return builder.call(pointer, [args[1]])

    return types.int64(types.int64, types.int64), generated


@overload(answered)  # type: ignore[untyped-decorator]
def _answered(address: Any, decision: Any) -> Any:
    def answer(address: Any, decision: Any) -> Any:
        return _called(address, decision)

    return answer
