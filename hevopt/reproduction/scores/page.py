"""The page of benchmarks, Markdown: every figure in it comes from `scored`, none is typed."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from hevopt.bounds.coarse import COARSE
from hevopt.reproduction.scores import highlander_page
from hevopt.reproduction.scores.analytic import LEVELS, Paper, even_load, on_off
from hevopt.reproduction.scores.bounds import Score, bound, found
from hevopt.reproduction.scores.small_hybrid import relaxed_problem, split_problem
from hevopt.reproduction.verdicts import markdown

COMMAND = "hevopt scores --out reports/scores.md"
SPLITS = (21, 51, 101, 201, 1001)
CELLS = 2001
Progress = Callable[[str, int, int], None]


class Scored(NamedTuple):
    """All that the page tells. papers: cases with their optimum by hand; splits: number of splits and what was
    found; all_splits_kg: bound of the small hybrid for every split, made between so many, cells; learnt: what is
    found on the car of a learning benchmark
    """

    papers: Sequence[tuple[Paper, Score]]
    splits: Sequence[tuple[int, Score]]
    all_splits_kg: float
    cells: int
    learnt: highlander_page.Learnt


def scored(progress: Progress, splits: Sequence[int] = SPLITS, cells: int = CELLS) -> Scored:
    """Every case, solved and certified. cells: splits between which the bound of all of them is made"""
    papers = [
        *(even_load(levels, known=False) for levels in LEVELS[:1]),
        *(even_load(levels) for levels in LEVELS),
        *(on_off(levels) for levels in LEVELS[:2]),
    ]
    alone = len(papers) + len(splits) + 1
    deciders = [*highlander_page.SOLVERS, *highlander_page.GOALS]
    total = alone + len(deciders)
    told = []
    for number, paper in enumerate(papers):
        progress(paper.name, number, total)
        told.append((paper, found(paper.problem)))
    hybrids = []
    for number, count in enumerate(splits):
        progress(f"{count} splits", len(papers) + number, total)
        hybrids.append((count, found(split_problem(count))))
    progress("all splits", alone - 1, total)
    least_kg = bound(relaxed_problem(cells))[0]
    learnt = highlander_page.scored(
        lambda name: progress(name, alone + deciders.index(name), total)
    )
    return Scored(told, hybrids, least_kg, cells, learnt)


def page(told: Scored, command: str = COMMAND) -> str:
    """The whole page. command: what makes it"""
    parts = [_head(command), _papers(told), _hybrid(told), highlander_page.section(told.learnt)]
    return "\n\n".join(parts) + "\n"


def _head(command: str) -> str:
    return f"""# Benchmarks: what is known of an optimum, and what is found

Made by `{command}`, every figure computed by it; the same inputs give the same page.

*dp* is what dynamic programming burns, driven with the true battery. *Bound*: no plan that ends with the charge
asked burns less; its scope says whether that is of the tabulated controls alone, or of every split between
them. *Coarse*: by how much the bound of every second control lies higher, where nothing is known of what lies
between; above {100 * COARSE:g} % hevopt warns."""


def _papers(told: Scored) -> str:
    laws = {paper.name: paper.law for paper, _ in told.papers}
    rows = [
        (
            paper.name,
            str(paper.levels),
            f"{paper.best_kg * 1e3:.4f}",
            _with_percent(case.fuel_kg, paper.best_kg),
            _with_percent(case.bound_kg, paper.best_kg),
            case.scope,
            _coarse(case),
        )
        for paper, case in told.papers
    ]
    heads = ("case", "levels", "by hand, g", "dp, g", "bound, g", "scope", "coarse")
    lines = "\n".join(f"- {name}: {law}." for name, law in laws.items())
    return f"""## By hand

{lines}

{markdown(heads, "lrrrrll", rows)}

The first line does not say what lies between its levels: its bound speaks of them alone, and lies above
what the engine could burn between them. With `between="convex"` the same levels give a bound of all between."""


def _hybrid(told: Scored) -> str:
    least_kg, finest = told.all_splits_kg, told.splits[-1]
    rows = [
        (
            str(count),
            f"{case.fuel_kg * 1e3:.2f}",
            f"{case.bound_kg * 1e3:.2f}",
            f"{100 * (case.fuel_kg / case.bound_kg - 1):.2f}",
            _coarse(case),
            f"{100 * (case.fuel_kg / least_kg - 1):.2f}",
        )
        for count, case in told.splits
    ]
    heads = (
        "splits", "dp, g", "bound of these splits, g", "dp above it, %", "coarse",
        "dp above the bound of all splits, %",
    )  # fmt: skip
    first, count = told.splits[0], finest[0]
    missed = 100 * (first[1].bound_kg / finest[1].fuel_kg - 1)
    return f"""## A small parallel hybrid

The example `hev` of DynaProg (F. Miretti, D. Misul, E. Spessa, SoftwareX 2021): UDDS, five gears free in every
second, the share of the machine as a control with 21 values. Its equations and its figures of ADVISOR in code of
our own; where the gearbox has a map there, it has one efficiency here, an estimate, so that the grams are those of
this car and not of that example, whose pages print none.

{markdown(heads, "rrrrlr", rows)}

**No split whatever burns less than {least_kg * 1e3:.2f} g**: between any two neighbours of {told.cells} splits a
control of the least fuel and the least power stands for all. With {first[0]} splits the bound, true of these alone,
lies {missed:.1f} % above a plan that exists with {count}, and is flagged. That plan lies
{100 * (finest[1].fuel_kg / least_kg - 1):.2f} % above the bound of all splits."""


def _with_percent(value_kg: float, best_kg: float) -> str:
    return f"{value_kg * 1e3:.4f} ({100 * (value_kg / best_kg - 1):+.3f} %)"


def _coarse(case: Score) -> str:
    if case.coarse is None:
        return "known"
    flag = ", **flagged**" if case.coarse > COARSE else ""
    return f"{100 * case.coarse:.3f} %{flag}"
