"""Carried out of hevopt/report.py."""

from collections.abc import Mapping, Sequence

from hevopt.strategies import STRATEGIES
from hevopt.studies.comparison import Comparison
from hevopt.studies.rows import Row
from hevopt.studies.status import Mark


def strategies_page(comparisons: Sequence[Comparison], steps: Mapping[str, int]) -> str:
    """Markdown: what each strategy knows, what a step costs to run, what it loses against the bound.

    steps: cycle -> number of its steps
    """
    cycles = [comparison.cycle for comparison in comparisons]
    rows = {
        (row.architecture, row.strategy, comparison.cycle): row
        for comparison in comparisons
        for row in comparison.rows
    }
    cars = list(dict.fromkeys(car for car, _, _ in rows))
    names = [name for name in STRATEGIES if any(name == strategy for _, strategy, _ in rows)]
    lines = [
        "# Strategies",
        "",
        "Made by `hevopt strategies --out reports/strategies.md`. Gap: cost above the certified bound at the",
        "row's own end charge, per cent; * not charge-neutral within 1 % of the fuel's energy; ! steps driven",
        "short of the cycle. ms: median over cars and cycles, the control table built.",
        "",
        "| strategy | knows | causal | ms per step |",
        "|---|---|---|---|",
    ]
    for name in names:
        times = sorted(
            1e3 * row.solve_s / steps[cycle]
            for (_, strategy, cycle), row in rows.items()
            if strategy == name and row.solve_s is not None
        )
        middle = f"{times[len(times) // 2]:.3f}" if times else "-"
        causal = "yes" if STRATEGIES[name].causal else "no"
        lines.append(f"| `{name}` | {STRATEGIES[name].knows} | {causal} | {middle} |")
    for car in cars:
        lines += ["", f"## {car}, gap %", "", "| strategy | " + " | ".join(cycles) + " |"]
        lines.append("|---" * (len(cycles) + 1) + "|")
        for name in names:
            cells = [_gap_cell(rows.get((car, name, cycle))) for cycle in cycles]
            lines.append(f"| `{name}` | " + " | ".join(cells) + " |")
    return "\n".join([*lines, ""])


def _gap_cell(row: Row | None) -> str:
    if row is None or row.gap_percent is None:
        return "-" if row is None else "failed"
    star = "*" if row.status.charge is Mark.NOT_NEUTRAL else ""
    return f"{row.gap_percent:.3f}{star}{'!' if row.status.shortfall_steps else ''}"
