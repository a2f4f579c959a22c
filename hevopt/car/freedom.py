"""What is free in a way to drive: torques to choose, what closes the balance, and rows that determine nothing.

By the ranks of small matrices: every shaft is a row of the torques' system, every joint a row of the speeds'.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from hevopt.car.driveline import BRAKE, ENGINE
from hevopt.car.linear import Coefficient
from hevopt.car.parts import WHEEL, Joint
from hevopt.errors import DataError

Array = NDArray[np.float64]
_TINY = 1e-9


class Freedom:
    """The torques of a way in numbers: which may be chosen, and what closes the balance."""

    def __init__(
        self,
        shafts: Sequence[str],
        joints: Sequence[Joint],
        active: Mapping[str, str],
        *,
        standing: bool,
    ) -> None:
        self.joints, self.shafts = joints, shafts
        self.names = [*(joint.name for joint in joints), *active, BRAKE]
        columns = [
            row({s: c0 + c1 for s, (c0, c1) in joint.reaction.items()}, shafts) for joint in joints
        ]
        columns += [row({shaft: 1.0}, shafts) for shaft in (*active.values(), WHEEL)]
        self.matrix = np.array(columns).T
        self.machines = [name for name in active if name != ENGINE]
        self.engine = [ENGINE] if ENGINE in active else []
        reached = self._reached({WHEEL}, shafts)
        self.wheels_moved = any(shaft in reached for shaft in active.values()) and not standing

    def choices(self, free_speed: bool, *, follows: bool) -> tuple[tuple[str, ...], str | None]:
        """The torques chosen, and the slack."""
        order = [*self.engine, *self.machines] if free_speed else [*self.machines, *self.engine]
        given = [BRAKE] if self.wheels_moved else []
        chosen = list(self.machines) if follows else []
        for name in order:
            if self._rank([*given, *chosen]) == len(self.names):
                break
            if self._rank([*given, *chosen, name]) > self._rank([*given, *chosen]):
                chosen.append(name)
        rows = self._rows([*given, *chosen])
        if np.linalg.matrix_rank(rows) < len(self.names):
            parts = ", ".join(self._undetermined(rows))
            raise DataError(
                f"driveline: the torques of {parts} are not determined: a redundant loop; leave one of its parts "
                "out, or open it by a clutch"
            )
        if len(rows) > len(self.names):
            parts = dependent(rows, [*self.shafts, *given, *chosen])
            raise DataError(
                f"driveline: nothing balances the torques on {parts}; give one of them an engine, a machine or "
                "a brake"
            )
        slack = None
        if self.wheels_moved:
            closers = [name for name in (*self.engine, *self.machines[::-1]) if name not in chosen]
            fits = (n for n in closers if self._rank([*chosen, n]) == len(self.names))
            slack = next(fits, None)
        return tuple(chosen), slack

    def solved_with(self, name: str, chosen: Sequence[str]) -> tuple[str, ...]:
        """The actuators that close the balance of the shafts on which a chosen torque acts."""
        given = [BRAKE, *chosen] if self.wheels_moved else list(chosen)
        inverse = np.linalg.pinv(self._rows(given))
        effect = inverse[:, self.matrix.shape[0] + given.index(name)]
        closers = [*self.engine, *self.machines]
        return tuple(
            n for n in closers if n not in chosen and abs(effect[self.names.index(n)]) > _TINY
        )

    def _rows(self, given: Sequence[str]) -> Array:
        units = [np.eye(len(self.names))[self.names.index(name)] for name in given]
        return np.vstack([self.matrix, *units]) if units else self.matrix

    def _rank(self, given: Sequence[str]) -> int:
        return int(np.linalg.matrix_rank(self._rows(given)))

    def _undetermined(self, rows: Array) -> list[str]:
        null = np.linalg.svd(rows)[2][np.linalg.matrix_rank(rows) :]
        return [n for n, x in zip(self.names, np.abs(null).max(0), strict=True) if x > _TINY]

    def _reached(self, start: set[str], shafts: Sequence[str]) -> set[str]:
        for _ in shafts:
            for joint in self.joints:
                if start & set(joint.reaction):
                    start = start | set(joint.reaction)
        return start


def row(coefficients: Mapping[str, Coefficient], shafts: Sequence[str]) -> Array:
    return np.array([float(coefficients.get(shaft, 0.0)) for shaft in shafts])


def loose(matrix: Array, shafts: Sequence[str]) -> list[str]:
    """The shafts whose speed rows do not determine."""
    rank = np.linalg.matrix_rank(matrix)
    if rank == len(shafts):
        return []
    spread = np.abs(np.linalg.svd(matrix)[2][rank:]).max(0)
    return [shaft for shaft, x in zip(shafts, spread, strict=True) if x > _TINY]


def dependent(matrix: Array, names: Sequence[str]) -> str:
    """The rows that depend on each other."""
    null = np.linalg.svd(matrix.T)[2][np.linalg.matrix_rank(matrix) :]
    found = [n for n, x in zip(names, np.abs(null).max(0), strict=True) if x > _TINY]
    return ", ".join(found)
