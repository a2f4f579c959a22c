"""Certificates: how little any plan could cost on the same problem, with the kind of proof.

A ladder of proofs, each dearer than the one before. The first two take milliseconds; the others are tried only
while the rollout's gap is above a target.

    one multiplier   one price on stored energy (prices.py)
    costate prices   a price per step, from the costate equation along the rollout (step_prices.py)
    LP prices        a price per step, from a linear program, where the rollout comes near an end of the window
                     (step_prices.py)
    segment prices   a price per step, one price a stretch between moments at such an end (segments.py)
    lower-bound DP   a cost-to-go that is nowhere above the true one, for costs of switching (lower_dp.py)

Where it is known what lies between the levels of a table (virtual.py), a bound by prices holds for every split
between them; else, as that of the lower-bound DP always, for the table's own controls, and a split between them
might cost less. Of arrays of which nothing is known it is told what that may come to: by how much the bound of
every second control lies higher (coarse.py). For every strategy of its scope it holds alike. The first four hold
for every end charge, moving with it by their price at the end; the last one for the asked end charge or more. Each
is lowered by what rounding could have added (prices.py, lower_dp.py) and then held against the plan in hand: one
above it is an error.
"""

import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from math import inf
from typing import NamedTuple

import numpy as np

from hevopt.bounds.claim import Claim, Proof, Scope
from hevopt.bounds.coarse import COARSE, coarseness_kg, coarseness_text
from hevopt.bounds.lines import Line
from hevopt.bounds.lower_dp import lower_bound_kg
from hevopt.bounds.prices import EPSILON, end_slack_j, one_price_dual, one_price_lines
from hevopt.bounds.segments import segment_dual
from hevopt.bounds.step_prices import costate_dual, lp_dual
from hevopt.bounds.virtual import split_of
from hevopt.display.facts import Shown
from hevopt.errors import CoarseTableWarning, SolverError
from hevopt.problem.problem import Problem, Trajectory

TARGET_GAP = 5e-4
LOWER_DP_NODES = (16_001, 64_001)
# Share of the window within which a rollout counts as near its end: one on a grid keeps a little off it.
_NEAR = 0.02


class Recursion(NamedTuple):
    """From what a lower-bound DP can be computed again: nodes of its grid and about what charge is worth."""

    nodes: int
    price_kgpj: float


@dataclass(frozen=True, slots=True, repr=False)
class Certificate(Shown):
    """Bounds on cost (kg: fuel, plus weighted NOx) for any end charge, as supporting lines.

    proofs: kind of proof -> its lines; the highest line at an end charge is the bound there
    at_least: kind of proof -> bound for end charges of end_min_j or more, end_slack_j less by rounding
    failures: kind of proof -> why it was tried and not found
    recursions: kind of proof -> from what its bound in at_least can be computed again
    scope: of what the lines speak; at_least speaks of the table's controls
    coarse_kg: by how much the bound of every second control lies higher, where nothing is known between them
    """

    end_min_j: float
    proofs: dict[Proof, list[Line]]
    at_least: dict[Proof, float] = field(default_factory=dict)
    failures: dict[Proof, str] = field(default_factory=dict)
    end_slack_j: float = 0.0
    recursions: dict[Proof, Recursion] = field(default_factory=dict)
    scope: Scope = Scope.TABULATED
    coarse_kg: float | None = None

    def _facts(self) -> dict[str, object]:
        bound_kg, proof = self.bound_kg(self.end_min_j)
        return {
            "bound_kg": bound_kg,
            "proof": proof,
            "scope": self.claim(proof).scope,
            **({} if self.coarse_kg is None else {"coarse_kg": self.coarse_kg}),
            "end_min_j": self.end_min_j,
            "price_kgpj": self.price_kgpj,
            "failures": list(self.failures),
        }

    def claim(self, proof: Proof) -> Claim:
        """What a bound of a kind of proof is: its kind and of what it speaks."""
        return Claim(proof, self.scope if proof in self.proofs else Scope.TABULATED)

    def bound_kg(self, end_j: float) -> tuple[float, Proof]:
        """The highest proven bound for plans that end with at least `end_j`, and its kind of proof."""
        return max(self._bounds(end_j))

    def bound_of(self, plan: Trajectory) -> tuple[float, Proof]:
        """The bound at a plan's own end charge and its kind of proof; at most the plan's cost, within rounding.

        Raises SolverError where a proof contradicts the plan.
        """
        bounds, rounding_kg = self._bounds(plan.end_j), _cost_rounding_kg(plan)
        for bound, kind in bounds:
            if bound - plan.cost_kg > rounding_kg:
                raise SolverError(
                    f"the proof contradicts a plan: by {kind} no plan that ends with its charge costs less than "
                    f"{bound:.12g} kg, and it costs {plan.cost_kg:.12g} kg; this is a fault of hevopt, not of "
                    "the inputs: please report this, with the inputs"
                )
        bound, kind = max(bounds)
        return min(bound, plan.cost_kg), kind

    def _bounds(self, end_j: float) -> list[tuple[float, Proof]]:
        extra_j = end_j - self.end_min_j
        rounding_j = 4 * EPSILON * (abs(end_j) + abs(self.end_min_j))
        bounds = [
            (line.value_kg + line.price_kgpj * (extra_j - rounding_j), kind)
            for kind, lines in self.proofs.items()
            for line in lines
        ]
        if extra_j >= -self.end_slack_j:
            bounds += [(bound, kind) for kind, bound in self.at_least.items()]
        return bounds

    @property
    def price_kgpj(self) -> float:
        """What a joule of end charge is worth on this problem: the price of the highest line."""
        lines = [line for group in self.proofs.values() for line in group]
        return max(lines, key=lambda line: line.value_kg).price_kgpj


def certify(
    problem: Problem, rollout: Trajectory | None = None, *, target_gap: float = TARGET_GAP
) -> Certificate:
    """The certificate of a problem; with a rollout, its costate prices, and dearer rungs up to `target_gap`.

    A rung that fails is left out and named in `failures`; left out is the lower-bound DP, which knows the
    controls of the table alone, where prices prove the rollout within the target among these. Raises
    SolverError where a bound is above the rollout. Warns, CoarseTableWarning, where the controls may be too few
    for what lies between them to be no better, by more than 0.05 %, and nothing is known of it.
    """
    split = split_of(problem)
    choices = None if split is None else split.choices
    lines = list(one_price_dual(problem) if choices is None else one_price_lines(problem, choices))
    certificate = Certificate(
        problem.end_min_j,
        {Proof.ONE_MULTIPLIER: lines},
        end_slack_j=end_slack_j(problem),
        scope=Scope.TABULATED if choices is None else Scope.CONTINUOUS,
        coarse_kg=coarseness_kg(problem),
    )
    _warn_of_coarseness(certificate)
    if rollout is None:
        return certificate
    worth = certificate.price_kgpj
    _gap(certificate, rollout)
    _try_prices(certificate, Proof.COSTATE_PRICES, lambda: costate_dual(problem, rollout, choices))
    gap = _gap(certificate, rollout)
    if gap > target_gap and _near_windows_end(problem, rollout):
        _try_prices(certificate, Proof.LP_PRICES, lambda: lp_dual(problem, rollout, choices))
        gap = _gap(certificate, rollout)
        if gap > target_gap:
            beside = certificate.proofs.get(Proof.LP_PRICES, [])
            _try_prices(
                certificate,
                Proof.SEGMENT_PRICES,
                lambda: segment_dual(problem, rollout, choices, beside),
            )
            gap = _gap(certificate, rollout)
    if gap > target_gap and choices is not None and _proven(problem, rollout, target_gap):
        return certificate
    for nodes in LOWER_DP_NODES:
        if gap <= target_gap:
            break
        best = certificate.at_least.get(Proof.LOWER_BOUND_DP, -inf)
        bound = lower_bound_kg(problem, worth, nodes=nodes)
        if bound > best:
            certificate.at_least[Proof.LOWER_BOUND_DP] = bound
            certificate.recursions[Proof.LOWER_BOUND_DP] = Recursion(nodes, worth)
        gap = _gap(certificate, rollout)
    return certificate


def _proven(problem: Problem, rollout: Trajectory, target_gap: float) -> bool:
    """Whether prices prove a rollout within the target among the table's own controls: what a bound of every split
    leaves open then lies between these, of which a recursion over the table says nothing."""
    try:
        line = costate_dual(problem, rollout)[-1]
    except SolverError:
        return False
    bound_kg = line.value_kg + line.price_kgpj * (rollout.end_j - problem.end_min_j)
    return rollout.cost_kg - bound_kg <= target_gap * abs(bound_kg)


def _warn_of_coarseness(certificate: Certificate) -> None:
    bound_kg, coarse_kg = certificate.bound_kg(certificate.end_min_j)[0], certificate.coarse_kg
    if coarse_kg is not None and coarse_kg > COARSE * abs(bound_kg):
        warnings.warn(coarseness_text(coarse_kg, bound_kg), CoarseTableWarning, stacklevel=3)


def _try_prices(certificate: Certificate, kind: Proof, lines: Callable[[], list[Line]]) -> None:
    """Add a rung; without its prices there is no proof of the kind, and the next one needs none."""
    try:
        certificate.proofs[kind] = lines()
    except SolverError as error:
        certificate.failures[kind] = str(error)


def _near_windows_end(problem: Problem, rollout: Trajectory) -> bool:
    low, high = problem.window_j
    margin = _NEAR * (high - low)
    return bool((rollout.energy_j < low + margin).any() or (rollout.energy_j > high - margin).any())


def _gap(certificate: Certificate, rollout: Trajectory) -> float:
    """How far the rollout is above its bound; every bound is held against it on the way."""
    bound, _ = certificate.bound_of(rollout)
    return (rollout.cost_kg - bound) / max(abs(bound), 1e-300)


def _cost_rounding_kg(plan: Trajectory) -> float:
    terms = float(np.sum(np.abs(plan.fuel_kg))) + abs(plan.cost_kg)
    return EPSILON * (2 * len(plan.fuel_kg) + 48) * terms
