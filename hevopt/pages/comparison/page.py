"""The page of a comparison, made from its saved form and nothing else."""

from dataclasses import dataclass
from statistics import median
from typing import Any

from hevopt.bounds.claim import PROOF_WORDS, SCOPE_WORDS
from hevopt.pages.comparison.alerts import alerts
from hevopt.pages.comparison.assumptions import assumptions
from hevopt.pages.comparison.results import Item, Results, SavedRow, Sensitivity
from hevopt.pages.comparison.sketch import sketch_of
from hevopt.pages.comparison.verdict import (
    all_electric,
    best_rows,
    charge_asked,
    reference_row,
    verdict,
)
from hevopt.pages.render import render
from hevopt.studies.rows import marked
from hevopt.studies.sensitivity import unsolved

_J_PER_KWH = 3.6e6


def comparison_page(results: Results) -> str:
    """The page as HTML, with the results inside."""
    calibrated = any(row.detail and row.detail.calibration for row in results.rows)
    scope = _scope(results)
    studies = [("Calibration of the rules", calibrated), ("Sensitivity", results.sensitivity)]
    return render(
        "comparison.html.j2",
        (
            "comparison_rows.js",
            "comparison_over.js",
            "comparison_row.js",
            "comparison_flow.js",
            "comparison.js",
        ),
        results.packed(),
        results=results,
        title=f"Comparison on {results.cycle}",
        verdict=verdict(results),
        alerts=alerts(results),
        reference=_reference(results),
        charge_asked=charge_asked(results),
        cars=[
            (name, car.about, sketch_of(car.about))
            for name, car in results.cars.items()
            if car.about is not None
        ],
        assumptions=assumptions(results),
        table=[_figures(row, scope) for row in results.rows],
        scope=scope,
        scope_words=SCOPE_WORDS,
        proofs=_proofs(results),
        electric=all_electric(results),
        worth=[_worth(results, row) for row in results.rows if row.detail is not None],
        energy=[_BalanceTable.of(results, row) for row in results.rows if row.detail is not None],
        spells=[_spells(row) for row in results.rows if row.detail is not None],
        chosen=_first_shown(results),
        effects=_effects(results),
        unsolved=unsolved(results.sensitivity or []),
        calibrated=calibrated,
        studied=", ".join(name for name, found in studies if found).capitalize(),
        left_out=_left_out(results),
    )


def _reference(results: Results) -> str | None:
    """The name of the row that all changes are against, and what is to be known of it."""
    base = reference_row(results)
    return None if base is None else f"{results.reference}{marked(base.status)}"


def _left_out(results: Results) -> list[str]:
    """Sections that an option would add."""
    options = (
        ("the front of fuel and NOx (hevopt compare --fronts adds it)", results.pareto),
        ("sensitivity (hevopt compare --sensitivity adds it)", results.sensitivity),
    )
    return [text for text, found in options if not found]


def _proofs(results: Results) -> list[tuple[str, str]]:
    """Kinds of proof that rows name, with what each is."""
    claims = [row.figures.certificate for row in results.rows]
    named = {str(claim.proof) for claim in claims if claim is not None}
    return [(str(proof), words) for proof, words in PROOF_WORDS.items() if proof in named]


def _scope(results: Results) -> str:
    """What all bounds of the table speak of; empty where they differ, or are not known."""
    claims = [row.figures.certificate for row in results.rows if row.figures.certificate]
    scopes = {str(claim.scope) for claim in claims}
    return scopes.pop() if len(scopes) == 1 and scopes <= set(SCOPE_WORDS) else ""


def _figures(row: SavedRow, scope: str) -> dict[str, Any]:
    """The row's figures, and what is derived from them for the table; scope: see `_scope`."""
    figures = row.figures
    derived: dict[str, Any] = {"co2_corrected_g_per_km": None, "delta_soc": None}
    if figures.fuel_l_per_100km:
        share = figures.fuel_corrected_l_per_100km / figures.fuel_l_per_100km
        derived["co2_corrected_g_per_km"] = figures.co2_g_per_km * share
    if figures.soc_end is not None:
        derived["delta_soc"] = figures.soc_end - figures.soc_start
    claim = figures.certificate
    proof = "" if claim is None else str(claim.proof if scope else claim)
    return figures.model_dump() | derived | {"proof": proof, "solved": row.detail is not None}


def _effects(results: Results) -> dict[str, list[Sensitivity]]:
    """Architecture and strategy -> its sensitivities, the largest on fuel first."""
    effects: dict[str, list[Sensitivity]] = {}
    for line in results.sensitivity or []:
        effects.setdefault(f"{line.architecture} {line.strategy}", []).append(line)
    for lines in effects.values():
        lines.sort(
            key=lambda line: (
                -max((abs(d) for d in line.delta_percent if d is not None), default=0.0)
            )
        )
    return effects


def _first_shown(results: Results) -> int:
    """Index of the row whose traces are shown first: the verdict's; -1 where no row was solved."""
    best = best_rows(results)
    return next((n for n, row in enumerate(results.rows) if best and row.figures is best[0]), -1)


def _worth(results: Results, row: SavedRow) -> dict[str, Any]:
    """What a joule in the battery is worth, and the price the strategy itself used; g/kWh and as efficiency."""
    car = results.cars[row.figures.architecture]
    own = row.detail.equivalence_kgpj
    return {
        "architecture": row.figures.architecture,
        "strategy": row.figures.strategy,
        "price_gpkwh": car.price_kgpj * 1e3 * _J_PER_KWH,
        "factor": car.price_kgpj * car.heating_value_jpkg,
        "efficiency_percent": _efficiency(car.price_kgpj, car.heating_value_jpkg),
        "own_gpkwh": None if own is None else own * 1e3 * _J_PER_KWH,
        "own_factor": None if own is None else own * car.heating_value_jpkg,
    }


def _efficiency(price_kgpj: float, heating_value_jpkg: float) -> float | None:
    fuel_j = price_kgpj * heating_value_jpkg
    return 100 / fuel_j if fuel_j > 0 else None


@dataclass(frozen=True, slots=True)
class _BalanceTable:
    """The energy balance of a row, ready to be printed: (name, kJ, MJ/km, per cent of what comes in)."""

    architecture: str
    strategy: str
    taken: list[tuple[str, float, float, float]]
    spent: list[tuple[str, float, float, float]]
    residual: tuple[str, float, float, float]
    total: tuple[str, float, float, float]
    of_which: list[tuple[str, float, float, float]]

    @classmethod
    def of(cls, results: Results, row: SavedRow) -> "_BalanceTable":
        energy = row.detail.energy
        whole_j = sum(item.energy_j for item in energy.taken)

        def line(name: str, energy_j: float) -> tuple[str, float, float, float]:
            share = 100 * energy_j / whole_j if whole_j > 0 else 0.0
            return name, energy_j / 1e3, energy_j / 1e3 / results.distance_m, share

        def lines(items: list[Item]) -> list[tuple[str, float, float, float]]:
            return [line(item.name, item.energy_j) for item in items if item.energy_j != 0]

        return cls(
            row.figures.architecture,
            row.figures.strategy,
            lines(energy.taken),
            lines(energy.spent),
            line("residual", energy.residual_j),
            line("sum", whole_j),
            lines(energy.of_which),
        )


def _spells(row: SavedRow) -> dict[str, Any]:
    detail = row.detail
    return {
        "architecture": row.figures.architecture,
        "strategy": row.figures.strategy,
        "starts": row.figures.engine_starts,
        "on": _summary(detail.engine_on_s),
        "off": _summary(detail.engine_off_s),
        "shares": detail.shares,
    }


def _summary(lengths_s: list[float]) -> dict[str, float | int | None]:
    if not lengths_s:
        return {"count": 0, "total_s": 0.0, "shortest_s": None, "median_s": None, "longest_s": None}
    return {
        "count": len(lengths_s),
        "total_s": sum(lengths_s),
        "shortest_s": min(lengths_s),
        "median_s": median(lengths_s),
        "longest_s": max(lengths_s),
    }
