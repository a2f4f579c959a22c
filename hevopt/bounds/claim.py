"""What a bound claims: how it was proven, and of which controls it speaks."""

from dataclasses import dataclass
from enum import StrEnum


class Proof(StrEnum):
    """How a bound was proven."""

    ONE_MULTIPLIER = "one multiplier"
    COSTATE_PRICES = "costate prices"
    LP_PRICES = "LP prices"
    SEGMENT_PRICES = "segment prices"
    LOWER_BOUND_DP = "lower-bound DP"


PROOF_WORDS: dict[str, str] = {
    Proof.ONE_MULTIPLIER: "one price on stored energy",
    Proof.COSTATE_PRICES: "one price per step, along the best plan found",
    Proof.LP_PRICES: "one price per step, of a linear program",
    Proof.SEGMENT_PRICES: "one price per step, of stretches between the window's ends",
    Proof.LOWER_BOUND_DP: "a cost-to-go nowhere above the true one",
}


class Scope(StrEnum):
    """What a bound speaks of: the table's controls, or every split between them as well."""

    TABULATED = "tabulated controls"
    CONTINUOUS = "continuous split"


SCOPE_WORDS: dict[str, str] = {
    Scope.TABULATED: "the levels of a joint alone",
    Scope.CONTINUOUS: "every torque between the levels of a joint",
}


@dataclass(frozen=True, slots=True)
class Claim:
    """What a bound is. Text of results saved by another version may name a proof that this one does not know."""

    proof: Proof | str
    scope: Scope | str = Scope.TABULATED

    def __str__(self) -> str:
        return f"{self.proof}, {self.scope}" if self.scope else str(self.proof)

    @classmethod
    def read(cls, text: object) -> "Claim":
        """The claim that a saved text stands for; ValueError for what is no text."""
        if not isinstance(text, str):
            raise ValueError("not the certificate of a row")
        proof, _, scope = text.partition(", ")
        return cls(
            Proof(proof) if proof in set(Proof) else proof,
            Scope(scope) if scope in set(Scope) else scope,
        )
