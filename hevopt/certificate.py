"""Certificates: how little any plan could cost on the same problem, with the kind of proof.

A ladder of proofs, each dearer than the one before. The first two take milliseconds; the others are tried only
while the rollout's gap is above a target.

    one multiplier   one price on stored energy (prices.py)
    costate prices   a price per step, from the costate equation along the rollout (step_prices.py)
    LP prices        a price per step, from a linear program, where the rollout touches the window (step_prices.py)
    lower-bound DP   a cost-to-go that is nowhere above the true one, for costs of switching (lower_dp.py)

A bound holds for the tabulated controls, for every strategy alike. The first three hold for every end charge,
moving with it by their price at the end; the last one for the asked end charge or more.
"""

from contextlib import suppress
from dataclasses import dataclass, field
from math import inf

from hevopt.errors import SolverError
from hevopt.lower_dp import lower_bound_kg
from hevopt.prices import Line, one_price_dual
from hevopt.problem import Problem, Trajectory
from hevopt.step_prices import costate_dual, lp_dual

TARGET_GAP = 5e-4
# What every bound speaks of: the table's controls, not a continuous split between them.
SCOPE = "tabulated controls"
LOWER_DP_NODES = (16_001, 64_001)
# Share of the window within which a rollout counts as touching its end.
_TOUCH = 2e-3
# Sums of some thousand terms: a bound is lowered by what rounding could have added.
_ROUNDING = 1e-12


@dataclass(frozen=True, slots=True)
class Certificate:
    """Bounds on cost (kg: fuel, plus weighted NOx) for any end charge, as supporting lines.

    proofs: kind of proof -> its lines; the highest line at an end charge is the bound there
    at_least: kind of proof -> bound for end charges of end_min_j or more
    """

    end_min_j: float
    proofs: dict[str, list[Line]]
    at_least: dict[str, float] = field(default_factory=dict)

    def bound_kg(self, end_j: float) -> tuple[float, str]:
        """The highest proven bound for plans that end with at least `end_j`, and its kind of proof."""
        extra_j = end_j - self.end_min_j
        bounds = [
            (line.value_kg + line.price_kgpj * extra_j, kind)
            for kind, lines in self.proofs.items()
            for line in lines
        ]
        if extra_j >= 0:
            bounds += [(bound, kind) for kind, bound in self.at_least.items()]
        best, kind = max(bounds)
        return best - _ROUNDING * abs(best), kind

    @property
    def price_kgpj(self) -> float:
        """What a joule of end charge is worth on this problem: the price of the highest line."""
        lines = [line for group in self.proofs.values() for line in group]
        return max(lines, key=lambda line: line.value_kg).price_kgpj


def certify(
    problem: Problem, rollout: Trajectory | None = None, *, target_gap: float = TARGET_GAP
) -> Certificate:
    """The certificate of a problem; with a rollout, its costate prices, and dearer rungs up to `target_gap`."""
    certificate = Certificate(problem.end_min_j, {"one multiplier": one_price_dual(problem)})
    if rollout is None:
        return certificate
    worth = certificate.price_kgpj
    certificate.proofs["costate prices"] = costate_dual(problem, rollout)
    if _gap(certificate, rollout) > target_gap and _touches_window(problem, rollout):
        # Without prices there is no proof of this kind; the next one needs none.
        with suppress(SolverError):
            certificate.proofs["LP prices"] = lp_dual(problem, rollout)
    for nodes in LOWER_DP_NODES:
        if _gap(certificate, rollout) <= target_gap:
            break
        best = certificate.at_least.get("lower-bound DP", -inf)
        bound = lower_bound_kg(problem, worth, nodes=nodes)
        certificate.at_least["lower-bound DP"] = max(best, bound)
    return certificate


def _touches_window(problem: Problem, rollout: Trajectory) -> bool:
    low, high = problem.window_j
    margin = _TOUCH * (high - low)
    return bool((rollout.energy_j < low + margin).any() or (rollout.energy_j > high - margin).any())


def _gap(certificate: Certificate, rollout: Trajectory) -> float:
    bound, _ = certificate.bound_kg(rollout.end_j)
    return (rollout.cost_kg - bound) / max(abs(bound), 1e-300)
