"""The page of the reproduction, Markdown: every figure in it comes from a Reproduction, none is typed."""

from collections.abc import Sequence

from hevopt.reproduction import sections
from hevopt.reproduction import variations as v
from hevopt.reproduction.cases import (
    JOINT_ELECTRIC,
    K_AND_STEEP,
    NO_PHYSICS,
    PHYSICS,
    Reproduction,
)
from hevopt.reproduction.details import members_of
from hevopt.reproduction.members import least_penalty
from hevopt.reproduction.published import (
    CYCLE,
    HYBRIDS,
    MEAN_NOX,
    MEAN_NOX_WITHOUT_C1,
    STATEMENTS,
    WHEEL_WORK_MJPKM,
    Statement,
    percent,
)
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
from hevopt.studies.comparison import Comparison
from hevopt.studies.rows import NEUTRAL_PERCENT

COMMAND = "hevopt reproduction --out reports/reproduction.md"


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
        _physics(found),
    ]
    return "\n\n".join(parts) + "\n"


def _head() -> str:
    share = f"{NEUTRAL_PERCENT:g} %"
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
or {about:g} where the text says "about". *Passed* means beyond it: the published figure lies between ours and
what the change makes of it. Whether less of the same change would reach it is not worked out; results may jump, as
a rule takes another member of its family. What reaches a figure can explain it; that it does would need the study's
own assumptions, which its text does not give.

A star marks what is not neutral: its end charge is off by more than {share} of the fuel's energy, or the charge
left its window on the way. Fuel is corrected there as everywhere, NOx nowhere; under each table with stars, another
says how far the end charge is above (+) or below (-) the start's and what the change is as driven, not corrected.
What as driven does not reach the published figure is *reached only after correction*."""


def _points(found: Reproduction) -> str:
    rows = []
    for statement in STATEMENTS:
        rows.append(_point(statement, statement.what, found))
        if statement is MEAN_NOX:
            rows.append(_point(MEAN_NOX_WITHOUT_C1, "the same without C1", found))
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


def _point(statement: Statement, what: str, found: Reproduction) -> list[str]:
    ours, section = statement.ours(found.shipped.cases), statement.section - 1
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
    gap = max(row.gap_percent or 0.0 for row in comparison.rows if row.strategy == "dp")
    heads = ["strategy", "change of", *HYBRIDS, "from least to most"]
    return (
        "## Ranking\n\n" + markdown(heads, "ll" + "r" * len(HYBRIDS) + "l", rows)
        + "\n\nThe fuel of `dp` is certified: no rule, however calibrated, that ends with the charge of "
        f"`dp` or more burns less by more than {gap:.3f} % on the same tables."
    )  # fmt: skip


def _ranked(comparison: Comparison, strategy: str) -> list[str]:
    fuel = {
        row.architecture: row.fuel_corrected_l_per_100km
        for row in comparison.rows
        if row.strategy == strategy and row.fuel_corrected_l_per_100km is not None
    }
    return sorted(fuel, key=lambda car: fuel[car])


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
    names = [v.K_PHASES.name, K_AND_STEEP.name, *(variation.name for variation in JOINT_ELECTRIC)]
    unders = [found.shipped, *(found.others[name] for name in names)]
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
    heads = ["point, %", "published", *(under.name for under in unders)]
    text = (
        "A cause that explains one point must not spoil another. The study has, without a figure in its text, "
        "a time in which a gear is being engaged, a NOx map, and a speed up to which it drives electrically: "
        "the first two together, and with both every speed of section 2, so that none is picked for what it gives."
    )
    return (
        f"## 7. Together\n\n{text}\n\n" + markdown(heads, "ll" + "r" * len(unders), rows)
        + "\n\n" + starred(unders, STATEMENTS)
        + f"\n\nReached in no column, not even after correction: {_reached_in_none(off)}. Nothing of it "
        "is taken over: files and rules stay as they are."
    )  # fmt: skip


def _reached_in_none(off: Sequence[Sequence[float]]) -> str:
    """The statements that no column reaches, with the points that the nearest leaves; off: column -> points."""
    left = []
    for n, statement in enumerate(STATEMENTS):
        nearest = min((column[n] for column in off), key=abs)
        if nearest:
            left.append(f"{statement.what} (at best {signed(nearest)} points)")
    return "; ".join(left) or "nothing"


def _physics(found: Reproduction) -> str:
    """How far each point was moved by what keeps the cars from being better than real ones."""
    unders = [found.others[variation.name] for variation in (*PHYSICS, NO_PHYSICS)]
    rows = []
    for s in (*STATEMENTS, MEAN_NOX_WITHOUT_C1):
        ours = s.ours(found.shipped.cases)
        without = [s.ours(under.cases) for under in unders]
        moved = [
            signed(ours - one) + star(under, s) for one, under in zip(without, unders, strict=True)
        ]
        rows.append([s.what, s.published, signed(ours), signed(without[-1]), *moved])
    heads = ["point, %", "published", "as shipped", "without all of it"]
    heads += ["braking shared", "round trip 0.90", "gear changes interrupt", "inertia", "all of it"]
    text = (
        "Four things were added to the cars after this page was first made: friction brakes take a share of the "
        "braking, the battery's round trip is the study's 0.90 (resistance as it follows from the peak power, the "
        "rest in the coulombic efficiency), a change of gear interrupts, and what shafts hold is paid for at "
        "every jump. How far each has moved a point: as shipped less what the page says without it. Columns need "
        "not add up, as rules are calibrated afresh and may take another member of their family."
    )
    return f"## 9. What honest physics moved\n\n{text}\n\n" + markdown(heads, "ll" + "r" * 7, rows)


def _own_rules(found: Reproduction) -> str:
    """What the differences show about our own rules."""
    rows, better = [], []
    for car in HYBRIDS:
        members = members_of(car, found)
        best = min(members, key=lambda m: m.fuel_percent)
        neutral = min(m.fuel_percent for m in members if m.neutral)
        penalty = least_penalty(found.families[car], 0)
        better += [car] if penalty is not None and round(penalty, 1) < 0 else []
        rows.append([car, f"{sum(not m.neutral for m in members)} of {len(members)}",
                     f"{sum(m.passed_over for m in members)}", signed(neutral),
                     signed(best.fuel_percent) + ("" if best.neutral else "*"),
                     "-" if penalty is None else signed(penalty)])  # fmt: skip
    heads = ["car", "members that are not neutral", "passed over", "fuel of the best neutral one, %",
             "fuel of the best of all, %", "least fuel of `nox_cut` against `conventional`, %"]  # fmt: skip
    text = (
        "`conventional` shifts the engine's load up and down: where braking gives back more than a low "
        "threshold uses, the machine assists with the rest. Before it shifted upwards only, and such members "
        "were not neutral. The calibration passes over all whose end charge is worth more than 1 % of the fuel, "
        "which may be neutral ones too: a joule of charge saves more than one of fuel. The members are those of "
        "the table in section 2, the calibrated one included; what the stars stand for is said there. "
        "`nox_cut` caps NOx besides. Cars with a member of its family that burns less than their "
        "`conventional`, which is then not the best rule of its kind: "
        f"{', '.join(better) or 'none'}."
    )
    return f"## 8. What this shows of our own rules\n\n{text}\n\n" + markdown(heads, "lrrrrr", rows)
