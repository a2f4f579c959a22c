"""The environment: an episode is one drive, an action the control of a step.

The return of an episode is the fuel of the drive, negative, with what its end charge is worth:

    return = -1000 [cost + p max(asked - end, 0) x short - p max(end - asked, 0)]        in grams of fuel

`cost` is what `simulate` adds up, `end` and `asked` are stored energy, p is the price of a certificate's line
cost >= v + p (end - asked), true of every plan whatever its end charge. With p >= 0 and short >= 1 no return is
above -1000 v: whoever empties the battery gains nothing by it that the bound does not know. p is what energy is
worth on this drive as a whole, so the reward knows the drive; the observation does not.
"""

from collections.abc import Mapping
from dataclasses import replace
from math import isfinite
from numbers import Integral, Real
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from hevopt.bounds.certificate import certify
from hevopt.errors import DataError, InfeasibleError
from hevopt.gym.observation import OBSERVED, limits, observed, taken
from hevopt.problem.arrays import Array, Flags
from hevopt.problem.problem import Problem, Trajectory
from hevopt.problem.simulation import simulate
from hevopt.strategies.stepper import stepped
from hevopt.strategies.stepwise import Step, Steps

_OPTIONS = ("problem", "soc_start")
Reset = tuple[Array, dict[str, Any]]


class HybridEnv(gymnasium.Env):  # type: ignore[misc]
    """Problems of one car, driven step by step.

    Actions are the indices of the table's controls. info["action_mask"], (control,) int8, tells which can be used,
    `action_masks()` the same; in the place of one that cannot be, the usable one of nearest battery power is taken,
    with the engine as asked if it can be, and info["replaced"] tells so. An observation is (11,) numbers, OBSERVED.
    A reward is that of the step alone, in g; the last one has what the end charge is worth. A step that is left
    without a usable control ends the episode, which then returns less than any drive that comes to its end.
    """

    metadata: Mapping[str, Any] = {"render_modes": []}

    def __init__(
        self, *problems: Problem, price_kgpj: float | None = None, short: float = 2.0
    ) -> None:
        """An environment that has driven nothing yet.

        problems: an episode drives one of them; drawn anew at every reset where there are several, by the seed of
        `reset`, or by its number in the options of `reset`
        price_kgpj: kg of fuel that a joule of end charge counts; by default that of each problem's certificate
        short: how many times that price a missing joule counts
        now: the present `Step`, all that a policy would see, for agents that look at every control
        problem, end_price_kgpj: what is driven, and what a joule of its end charge counts
        DataError for problems of different cars, or values that are none.
        """
        _check(problems, price_kgpj, short)
        self._problems, self._price_kgpj, self._short = problems, price_kgpj, short
        self._worth: dict[int, float] = {}
        self.action_space = spaces.Discrete(len(problems[0].table.controls))
        low, high = limits(problems)
        self.observation_space = spaces.Box(low, high, (len(OBSERVED),), np.float64)
        self.problem = problems[0]
        self.now: Step | None = None
        self.end_price_kgpj = 0.0
        self._steps = Steps(self.problem)
        self._control: list[int] = []
        self._cost_kg = 0.0
        self._over = True

    def reset(self, *, seed: int | None = None, options: Mapping[str, Any] | None = None) -> Reset:
        """The first observation of a drive and its info.

        seed: of the draw among several problems; one problem is always the same
        options: problem: number of one of the problems; soc_start: state of charge at the start
        DataError for options that are none, InfeasibleError where the first step has no usable control, or no plan
        reaches the charge asked at the end.
        """
        if seed is not None and not (isinstance(seed, Integral) and seed >= 0):
            raise DataError(f"reset: seed = {repr(seed)[:40]}; allowed: an integer, 0 or more")
        super().reset(seed=None if seed is None else int(seed))
        options = {} if options is None else options
        if not isinstance(options, Mapping):
            raise DataError(f"reset: options = {repr(options)[:40]}; needed: a dict")
        if set(options) - set(_OPTIONS):
            raise DataError(f"reset: options {list(options)}; allowed: {', '.join(_OPTIONS)}")
        count = len(self._problems)
        number = options.get("problem", self.np_random.integers(count) if count > 1 else 0)
        if isinstance(number, bool) or number not in range(count):
            raise DataError(f"reset: problem = {number!r}; allowed: 0 to {count - 1}")
        self._number = int(number)
        problem = self._problems[self._number]
        if "soc_start" in options:
            problem = replace(problem, soc_start=_number(options["soc_start"]))
        self.problem, self._steps = problem, Steps(problem)
        self._control, self._cost_kg = [], 0.0
        self._at(0, problem.start_j, problem.start_mode)
        if self._over:
            raise InfeasibleError("step 0 has no usable control; see reject of the table")
        self.end_price_kgpj = self._price_of(self._number)
        return self._observation, self._info()

    def step(self, action: Any) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Drive a step: observation, reward, whether the drive is over, False, info.

        info: action_mask and soc after it; control and replaced, what was taken; fuel_kg, with switching; nox_kg
        DataError where the drive is over, or for what is no index of a control.
        """
        if self._over or self.now is None:
            raise DataError("the drive is over; reset begins another")
        now, problem = self.now, self.problem
        control = taken(now, action)
        energy_j, mode = stepped(problem, now.k, now.energy_j, now.mode, control)
        self._control.append(control)
        switch_kg = float(now.switch_fuel_kg[control])
        cost_kg = float(problem.cost_kg[now.k, control]) + switch_kg
        self._cost_kg += cost_kg
        self._at(now.k + 1, energy_j, mode)
        if self._over:
            cost_kg += self._ending_kg(energy_j)
        done = {
            "control": control,
            "replaced": bool(control != action),
            "fuel_kg": float(now.fuel_kg[control]) + switch_kg,
            "nox_kg": float(now.nox_kg[control]),
        }
        return self._observation, -1e3 * cost_kg, self._over, False, self._info() | done

    def action_masks(self) -> Flags:
        """(control,) whether each control can be used in the present step."""
        return self._mask

    def trajectory(self) -> Trajectory:
        """What the drive was, as `simulate` adds it up; `certify` takes it like that of any strategy.

        DataError while it is not over, InfeasibleError where no control was left.
        """
        if not self._over or not self._control:
            raise DataError(f"the drive is not over: {len(self._control)} steps were driven")
        left = len(self.problem.table.time_s) - len(self._control)
        if left:
            k = len(self._control)
            raise InfeasibleError(
                f"the drive ended at step {k} (t = {self.problem.table.time_s[k]:g} s), {left} before its end: no "
                "control was left there"
            )
        return simulate(self.problem, np.array(self._control))

    def _price_of(self, number: int) -> float:
        """What a joule of end charge counts in a problem."""
        if self._price_kgpj is not None:
            return self._price_kgpj
        if number not in self._worth:
            self._worth[number] = certify(self._problems[number]).price_kgpj
        return self._worth[number]

    def _at(self, k: int, energy_j: float, mode: int) -> None:
        """Come to a step, or to the end."""
        ended = k == len(self.problem.table.time_s)
        now = self._steps.at(k - 1 if ended else k, energy_j, mode)
        if ended:
            now = _standing(now)
        self.now, self._mask = now, now.usable
        self._over = not self._mask.any()
        self._observation = observed(now)

    def _info(self) -> dict[str, Any]:
        assert self.now is not None  # set by every reset
        return {"action_mask": self._mask.astype(np.int8), "soc": self.now.soc}

    def _ending_kg(self, energy_j: float) -> float:
        """What the end counts: charge missing or left over; all up to the dearest drive that could be, for a drive
        that does not come to its end."""
        price, problem = self.end_price_kgpj, self.problem
        if len(self._control) == len(problem.table.time_s):
            surplus_j = energy_j - problem.end_min_j
            return -price * surplus_j * (1.0 if surplus_j > 0 else self._short)
        usable = problem.table.feasible
        dearest_kg = float(np.where(usable, problem.cost_kg, -np.inf).max(axis=1).sum())
        switch_kg = len(usable) * float(problem.table.switch_fuel_kg.max())
        missing_j = problem.end_min_j - problem.window_j[0]
        return dearest_kg + switch_kg + price * self._short * missing_j - self._cost_kg


def _number(soc_start: Any) -> float:
    try:
        return float(soc_start)
    except (TypeError, ValueError):
        raise DataError(
            f"reset: soc_start = {soc_start!r}; allowed: a state of charge, 0 to 1"
        ) from None


def _standing(now: Step) -> Step:
    """The end of a drive, a step at which nothing moves and nothing can be chosen."""
    nothing: NDArray[np.bool_] = np.zeros_like(now.usable)
    return now._replace(usable=nothing, speed_mps=0.0, wheel_power_w=0.0, gear=0)


def _check(problems: tuple[Problem, ...], price_kgpj: float | None, short: float) -> None:
    if not problems:
        raise DataError("HybridEnv: no problem; needed: one, or several of the same car")
    for number, problem in enumerate(problems):
        if not isinstance(problem, Problem):
            raise DataError(
                f"HybridEnv: problem {number} is a {type(problem).__name__}; needed: a Problem, as of "
                "build_problem, several as HybridEnv(one, another)"
            )
    first = problems[0].table
    for number, problem in enumerate(problems):
        table = problem.table
        if table.controls != first.controls or not np.array_equal(table.mode, first.mode):
            raise DataError(
                f"HybridEnv: problem {number} has other controls than problem 0; needed: problems of the same car"
            )
    if price_kgpj is not None and not _at_least(price_kgpj, 0.0):
        raise DataError(
            f"HybridEnv: price_kgpj = {repr(price_kgpj)[:40]}; allowed: 0 or more, in kg fuel per J"
        )
    if not _at_least(short, 1.0):
        raise DataError(f"HybridEnv: short = {repr(short)[:40]}; allowed: 1 or more")


def _at_least(value: Any, least: float) -> bool:
    return isinstance(value, Real) and isfinite(value) and float(value) >= least
