"""What a sizing found: every design judged, the best of them, and what is proven."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import fsum
from pathlib import Path

from hevopt.display.facts import Shown
from hevopt.sizing.around import Lattice
from hevopt.sizing.candidates import Candidate, Fate, least_bound, rank
from hevopt.sizing.proof.prove import RangeProof
from hevopt.sizing.study_file import SizeStudy


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Sizing(Shown):
    """What a sizing found.

    lattice: whether every design there is was judged; found: all, in order
    proofs: by cycle, what no car of the ranges is below; unproven: why there are none, and then
    around: the lattice around the best design
    """

    study: SizeStudy
    store: Path
    lattice: bool
    found: Sequence[Candidate]
    proofs: tuple[RangeProof, ...] = ()
    unproven: str = ""
    around: Lattice | None = None

    def _facts(self) -> dict[str, object]:
        best = self.best
        return {"store": self.store, **self.counts, "best": best and dict(best.design.values)}

    @property
    def counts(self) -> Mapping[str, int]:
        """Fate -> how many designs had it."""
        fates = [one.fate for one in self.found]
        return {str(fate): fates.count(fate) for fate in Fate}

    @property
    def solved(self) -> list[Candidate]:
        """Designs that meet all requirements and were solved."""
        return [one for one in self.found if one.fate is Fate.SOLVED]

    @property
    def front(self) -> list[Candidate]:
        """Designs that no other one is as good as in every objective, the first objective's least first."""
        kept: list[Candidate] = []
        for one in sorted(self.solved, key=rank):
            values = one.values or ()
            if not any(
                all(a <= b for a, b in zip(k.values or (), values, strict=True)) for k in kept
            ):
                kept.append(one)
        return kept

    @property
    def best(self) -> Candidate | None:
        """The design of the least first objective; None where none meets what is asked."""
        return next(iter(self.front), None)

    @property
    def least(self) -> float | None:
        """What no design judged can be below in the first objective: the least bound. None where one has none."""
        return least_bound(self.found)

    @property
    def proven(self) -> float | None:
        """What no car of the ranges is below in the first objective, requirements apart; None without a proof."""
        car = None if self.best is None else self.best.car
        if not self.proofs or car is None:
            return None
        litres = [proof.bound_l_per_100km for proof in self.proofs]
        mean = fsum(w * f for w, f in zip(self.study.weights, litres, strict=True))
        return self.study.objectives[0].value(car, mean)
