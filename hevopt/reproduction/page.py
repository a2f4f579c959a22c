"""The page of the reproduction, Markdown: every figure in it comes from a Reproduction, none is typed."""

from hevopt.published import (
    CYCLE,
    HYBRIDS,
    MEAN_NOX_WITHOUT_C1,
    STATEMENTS,
    WHEEL_WORK_MJPKM,
    Statement,
    percent,
)
from hevopt.reproduction import sections
from hevopt.reproduction.cases import JOINT, NEUTRAL_WORTH_PERCENT, Reproduction, least_penalty
from hevopt.reproduction.details import members_of
from hevopt.reproduction.verdicts import (
    driven,
    markdown,
    off_text,
    points_off,
    signed,
    standing,
    star,
    starred,
)
from hevopt.study import Comparison

COMMAND = "hevopt reproduction --out reports/reproduction.md"
_MEAN_NOX = STATEMENTS[4]


def page(found: Reproduction) -> str:
    """The whole page."""
    parts = [
        _head(),
        _points(found),
        _ranking(found.comparison),
        sections.fuel_of_b(found),
        sections.fuel_of_hybrids(found),
        sections.nox_of_b(found),
        sections.nox_of_hybrids(found),
        sections.nox_cut(found),
        _wheel_work(found),
        _joint(found),
        _own_rules(found),
    ]
    return "\n\n".join(parts) + "\n"


def _head() -> str:
    share = f"{NEUTRAL_WORTH_PERCENT:g} %"
    whole, about = min(s.rounding for s in STATEMENTS), max(s.rounding for s in STATEMENTS)
    return f"""# The published study beside ours

Made by `{COMMAND}`, every figure computed by it; the same inputs give the same page.

The study: F. Millo, L. Rolando, M. Andreata, *Numerical Simulation for Vehicle Powertrain Development*, in
*Numerical Analysis - Theory and Application* (2011), section 4.2. {CYCLE.upper()}, warm engine, there and here.
Changes are against the conventional car A unless a table says otherwise. Ours is tuned to nothing on this page:
the cars are the shipped files, the strategies the shipped rules. Fuel is charge-corrected.

Each section changes one assumption at a time, in A as well where A has it (A's alternator keeps its efficiency but
where that itself is changed), solves and calibrates everything afresh, and says what that moves.

*Reached* means within the rounding of the published figure: {whole:g} points,
or {about:g} where the text says "about". *Passed* means beyond it, so that less of the same change would reach it.
What reaches a figure can explain it; that it does would need the study's own assumptions, which its text does not
give. A star marks what is not neutral: its end charge is worth more than {share} of its fuel, or the charge left
its window on the way. Fuel is corrected there as everywhere, NOx nowhere; under each table with stars, another says
how far the end charge is above (+) or below (-) the start's and what the change is as driven, without correction.
What as driven does not reach the published figure is *reached only after correction*."""


def _points(found: Reproduction) -> str:
    rows = []
    for statement, section in zip(STATEMENTS, sections.SECTION_OF, strict=True):
        rows.append(_point(statement, statement.what, section, found))
        if statement is _MEAN_NOX:
            rows.append(_point(MEAN_NOX_WITHOUT_C1, "the same without C1", section, found))
    work = found.work_mjpkm["A as shipped"]
    same = round(work, 1) == WHEEL_WORK_MJPKM
    off = "within rounding" if same else f"{signed(work - WHEEL_WORK_MJPKM, 3)} MJ/km"
    rows.append(["energy at the wheels", f"about {WHEEL_WORK_MJPKM:g} MJ/km", f"{work:.3f} MJ/km", off,
                 "agrees" if same else "**not explained**", _link(len(sections.TITLES) - 1)])  # fmt: skip
    best = _ranked(found.comparison, "nox_cut")[0]
    rows.append(["least fuel with NOx cut", "C2", best, "none" if best == "C2" else "another",
                 "agrees" if best == "C2" else "**not explained**", "[Ranking](#ranking)"])  # fmt: skip
    heads = ["point", "published", "ours", "difference", "the difference is", "what moves it"]
    return "## Point by point\n\n" + markdown(heads, "llrlll", rows)


def _link(section: int) -> str:
    return f"[{sections.TITLES[section]}]({sections.anchor(section)})"


def _point(statement: Statement, what: str, section: int, found: Reproduction) -> list[str]:
    ours = statement.ours(found.shipped.cases)
    explained = standing(statement, found, sections.others_of(section, found))
    off = off_text(statement, ours)
    return [what, statement.published, f"{signed(ours)} %", off, explained, _link(section)]


def _ranking(comparison: Comparison) -> str:
    base = next(row for row in comparison.rows if row.architecture == "A")
    rows = []
    for name in ("conventional", "nox_cut", "dp"):
        of = {r.architecture: r for r in comparison.rows if r.strategy == name}
        for what, key in (("fuel", "fuel_corrected_l_per_100km"), ("NOx", "nox_mg_per_km")):
            change = {c: percent(getattr(of[c], key), getattr(base, key)) for c in HYBRIDS}
            order = " < ".join(sorted(HYBRIDS, key=lambda car: change[car]))
            rows.append([f"`{name}`", what, *(f"{signed(change[c])} %" for c in HYBRIDS), order])
    gap = max(row.gap_percent for row in comparison.rows if row.strategy == "dp")
    heads = ["strategy", "change of", *HYBRIDS, "from least to most"]
    return (
        "## Ranking\n\n" + markdown(heads, "ll" + "r" * len(HYBRIDS) + "l", rows)
        + "\n\nThe fuel of `dp` is certified: no rule, however calibrated, burns less by more than "
        f"{gap:.3f} % on the same tables."
    )  # fmt: skip


def _ranked(comparison: Comparison, strategy: str) -> list[str]:
    rows = [row for row in comparison.rows if row.strategy == strategy]
    return [r.architecture for r in sorted(rows, key=lambda r: r.fuel_corrected_l_per_100km)]


def _wheel_work(found: Reproduction) -> str:
    shipped = found.work_mjpkm["A as shipped"]
    rows = [
        [what, f"{work:.3f}", "" if work == shipped else signed(work - shipped, 3)]
        for what, work in found.work_mjpkm.items()
    ]
    rows.append(["*published*", f"about {WHEEL_WORK_MJPKM:g}", ""])
    heads = ["what is another", "positive work at the wheels, MJ/km", "moved by"]
    text = "It depends on mass and road load alone. The study does not say whose it is."
    return f"## {sections.TITLES[-1]}\n\n{text}\n\n" + markdown(heads, "lrr", rows)


def _joint(found: Reproduction) -> str:
    """Several assumptions at once, all statements under each set."""
    unders = [found.shipped] + [found.others[variation.name] for variation in JOINT[1:]]
    rows = [
        [s.what, s.published, *(signed(s.ours(u.cases)) + star(u, s) for u in unders)]
        for s in STATEMENTS
    ]
    off = [[points_off(s, s.ours(u.cases)) for s in STATEMENTS] for u in unders]
    firm = [[not points_off(s, driven(u, s)) for s in STATEMENTS] for u in unders]
    counts = [
        (sum(not o and f for o, f in zip(offs, firms, strict=True)), sum(not o for o in offs))
        for offs, firms in zip(off, firm, strict=True)
    ]
    rows.append(["reached", "", *(f"{sure} of {len(STATEMENTS)}" for sure, _ in counts)])
    rows.append(
        ["reached only after correction", "", *(f"{every - sure}" for sure, every in counts)]
    )
    left = [f"{s.what} ({signed(o)} points)" for s, o in zip(STATEMENTS, off[-1], strict=True) if o]
    heads = ["point, %", "published", *(under.name for under in unders)]
    text = (
        "A cause that explains one point must not spoil another. Each column keeps what the one "
        "before it changed."
    )
    return (
        f"## 7. Together\n\n{text}\n\n" + markdown(heads, "ll" + "r" * len(unders), rows)
        + "\n\n" + starred(unders, STATEMENTS)
        + f"\n\nNot explained by the last column: {'; '.join(left) or 'nothing'}. Nothing of it is "
        "taken over: files and rules stay as they are."
    )  # fmt: skip


def _own_rules(found: Reproduction) -> str:
    """What the differences show about our own rules."""
    rows = []
    for car in HYBRIDS:
        members = members_of(car, found)
        best = min(members, key=lambda m: m.fuel_percent)
        neutral = min(m.fuel_percent for m in members if m.neutral)
        rows.append([car, f"{sum(not m.neutral for m in members)} of {len(members)}", signed(neutral),
                     signed(best.fuel_percent) + ("" if best.neutral else "*"),
                     _or_dash(least_penalty(found.families[car], 0))])  # fmt: skip
    heads = ["car", "members that are not neutral", "fuel of the best neutral one, %",
             "fuel of the best of all, %", "least fuel of `nox_cut` against `conventional`, %"]  # fmt: skip
    text = (
        "`conventional` shifts the engine's load upwards only. Where braking gives back more "
        "than a low threshold uses, it cannot spend the rest: such members are not neutral, and "
        "the calibration passes them over. The members are those of the table in section 2, the "
        "calibrated one included; what the stars stand for is said there. `nox_cut` may assist; "
        "where a member of its family burns less than `conventional`, as in the last column, "
        "`conventional` is not the best rule of its kind."
    )
    return f"## 8. What this shows of our own rules\n\n{text}\n\n" + markdown(heads, "lrrrr", rows)


def _or_dash(value: float | None) -> str:
    return "-" if value is None else signed(value)
