"""One section for each difference: what moves it and by how much, and the verdict."""

from collections.abc import Sequence
from itertools import pairwise

from hevopt.published import HYBRIDS, STATEMENTS, Statement
from hevopt.reproduction import variations as v
from hevopt.reproduction.cases import (
    CUTS_PERCENT,
    K_AND_STEEP,
    LOSSES,
    Balance,
    Reproduction,
    Under,
    least_penalty,
)
from hevopt.reproduction.verdicts import markdown, signed, star, verdict

TITLES = (
    "1. Fuel of B",
    "2. Fuel of C2 and D, conventional",
    "3. NOx of B",
    "4. NOx of the hybrids, conventional",
    "5. NOx cut",
    "6. Energy at the wheels",
)
# Section of each published statement.
SECTION_OF = (0, 1, 1, 2, 3, 4, 4, 4, 4)
_LOSSES_ALL = (
    v.DRIVELINE, v.MACHINE_LOSS, v.RESISTANCE, v.HYBRID_MASS, v.AUXILIARIES, v.ROAD, LOSSES,
)  # fmt: skip
_BRAKING = (*v.ELECTRIC, *v.BRAKING, v.NO_RECOVERY)
_ENGINE = (v.FREE_STARTS, v.DEAR_STARTS, v.NO_INERTIA)
# What each section with statements varies.
VARIATIONS_OF = (
    (v.K_PHASES, *_ENGINE, v.ALTERNATOR, *_LOSSES_ALL),
    (*_BRAKING, v.K_PHASES, *_ENGINE, v.ALTERNATOR, *_LOSSES_ALL),
    (v.STEEP_NOX, v.K_PHASES, K_AND_STEEP, *_ENGINE, v.ALTERNATOR, *_LOSSES_ALL),
    (v.STEEP_NOX, v.K_PHASES, K_AND_STEEP, *_BRAKING, *_ENGINE, v.ALTERNATOR, *_LOSSES_ALL),
    (v.STEEP_NOX, v.K_PHASES, *_BRAKING, *_ENGINE, v.ALTERNATOR, *_LOSSES_ALL),
)
# What moves no figure by so many points is named, not tabulated.
_NOTHING = 0.05
# Points of fuel within which members of a curve count as equals.
_NEAR_LEAST_FUEL = 2.0


def anchor(section: int) -> str:
    """Where a link to a section goes: its heading as Markdown viewers name it."""
    kept = "".join(c for c in TITLES[section].lower() if c.isalnum() or c == " ")
    return "#" + kept.replace(" ", "-")


def fuel_of_b(found: Reproduction) -> str:
    """Section 1."""
    return _section(
        0, found,
        "B saves what the engine burns at standstill. In the study it rests there, but not while "
        "a gear is being engaged before moving off. Ours keeps it turning wherever the cycle's "
        "gear column has a gear engaged at standstill, the K phases, the long one before the "
        "extra-urban part included. A's alternator is less efficient than B's machine: that is "
        "part of the gain.",
    )  # fmt: skip


def fuel_of_hybrids(found: Reproduction) -> str:
    """Section 2."""
    text = (
        "The study drives electrically up to some power or speed and gives neither. Ours takes the "
        "power threshold of least fuel and no speed threshold. Ours brakes with the machine as far "
        "as it reaches and leaves nothing to the axle that is not driven. The engine's inertia is "
        "charged on its own shaft, in A and in the hybrids alike: it moves both and hardly their "
        "ratio."
    )
    return "\n\n".join([_section(1, found, text), _balances(found), _curves(found)])


def nox_of_b(found: Reproduction) -> str:
    """Section 3."""
    return _section(
        2, found,
        "What start-stop saves of NOx is what the map emits at idle speed without load, where "
        "the two maps differ most.",
    )  # fmt: skip


def nox_of_hybrids(found: Reproduction) -> str:
    """Section 4."""
    text = (
        "`conventional` is calibrated for fuel alone; its NOx follows from where the engine makes "
        "up the charge."
    )
    return _section(3, found, text) + "\n\n" + _nox_spread(found)


def nox_cut(found: Reproduction) -> str:
    """Section 5."""
    text = (
        "The study does not say how far it cuts; ours takes the family's member of least NOx, "
        "whatever it costs in fuel, and measures it against a `conventional` whose NOx is left "
        "to chance (section 4)."
    )
    return _section(4, found, text) + "\n\n" + _trade_off(found)


def others_of(section: int, found: Reproduction) -> list[Under]:
    """The study under each variation of a section."""
    return [found.others[variation.name] for variation in VARIATIONS_OF[section]]


def _section(section: int, found: Reproduction, text: str) -> str:
    """Text, a table of what each variation moves, and a verdict for each statement of the section."""
    statements = [s for s, n in zip(STATEMENTS, SECTION_OF, strict=True) if n == section]
    others = others_of(section, found)
    idle = [u for u in others if not _moves(u, found.shipped, statements)]
    heads = ["what is another", "A, l/100 km"]
    for statement in statements:
        heads += [f"{statement.what}, %", "moved by"]
    rows = [
        _line(under, found.shipped, statements)
        for under in [found.shipped, *(u for u in others if u not in idle)]
    ]
    rows.append(["*published*", "", *(cell for s in statements for cell in (s.published, ""))])
    parts = [f"## {TITLES[section]}", text, markdown(heads, "lr" + "rr" * len(statements), rows)]
    if idle:
        names = "; ".join(under.name for under in idle)
        parts.append(f"Moving nothing by {_NOTHING:g} points: {names}.")
    parts.append("\n".join(f"- {s.what}: {verdict(s, found, others)}" for s in statements))
    return "\n\n".join(parts)


def _moves(under: Under, shipped: Under, statements: Sequence[Statement]) -> bool:
    moved = [s.ours(under.cases) - s.ours(shipped.cases) for s in statements]
    return any(abs(points) >= _NOTHING for points in moved)


def _line(under: Under, shipped: Under, statements: Sequence[Statement]) -> list[str]:
    cells = [under.name, f"{under.cases['A', 'baseline'].fuel_l_per_100km:.3f}"]
    for statement in statements:
        value = statement.ours(under.cases)
        moved = "" if under is shipped else signed(value - statement.ours(shipped.cases))
        cells += [signed(value) + star(under, statement), moved]
    return cells


def _balances(found: Reproduction) -> str:
    """Energies of every car, and what of the braking is recovered."""
    names = [name.replace("_", " ") for name in Balance._fields[:-1]]
    heads = ["kJ/km", *names, "engine efficiency, %", "recovered of braking, %"]
    rows = []
    for car, balance in found.balances.items():
        share = 100 * balance.recovered / balance.braking
        energies = [f"{value:.0f}" for value in balance[:-1]]
        rows.append([car, *energies, f"{balance.engine_efficiency:.1f}", f"{share:.0f}"])
    text = (
        "Where the energy of ours goes (A `baseline`, B `start_stop`, the others "
        "`conventional`). Traction and braking: at the wheels; recovered: taken by the battery "
        "at its terminals meanwhile; idle fuel: burnt at standstill; engine efficiency: its mean "
        "while it burns."
    )
    return text + "\n\n" + markdown(heads, "l" + "r" * (len(heads) - 1), rows)


def _curves(found: Reproduction) -> str:
    """The calibration curve, and where it passes the published fuel."""
    rows = []
    for members in zip(*(found.curves[car] for car in HYBRIDS), strict=True):
        cells = [f"{members[0].threshold_w / 1e3:g}"]
        for member in members:
            mark = "" if member.neutral else "*"
            cells += [signed(member.fuel_percent) + mark, signed(member.nox_percent)]
        rows.append(cells)
    heads = ["electric below, kW"]
    heads += [f"{car} {what}, %" for car in HYBRIDS for what in ("fuel", "NOx")]
    passes = [f"- {s.cars[0]}: {_passes(found, s)}" for s in STATEMENTS[1:3]]
    text = (
        "The calibration curve of `conventional`: change against A over the power threshold "
        "below which the car drives electrically."
    )
    return "\n\n".join(
        [
            text,
            markdown(heads, "r" * len(heads), rows),
            "Where it passes the published fuel:",
            "\n".join(passes),
        ]
    )


def _passes(found: Reproduction, statement: Statement) -> str:
    members = found.curves[statement.cars[0]]
    middle, places = (statement.low + statement.high) / 2, []
    for before, after in pairwise(members):
        low, high = sorted((before.fuel_percent, after.fuel_percent))
        if low <= middle < high:
            share = (middle - before.fuel_percent) / (after.fuel_percent - before.fuel_percent)
            kw = (before.threshold_w + share * (after.threshold_w - before.threshold_w)) / 1e3
            nox = before.nox_percent + share * (after.nox_percent - before.nox_percent)
            places.append(f"at {kw:.1f} kW, with NOx {signed(nox)} %")
    least = min((m for m in members if m.neutral), key=lambda m: m.fuel_percent)
    where = "; ".join(places) or "nowhere"
    return (
        f"{middle:g} % {where}; least fuel of neutral members {signed(least.fuel_percent)} % at "
        f"{least.threshold_w / 1e3:g} kW."
    )


def _nox_spread(found: Reproduction) -> str:
    """How much NOx differs among members whose fuel hardly does."""
    spreads = []
    for car in HYBRIDS:
        neutral = [m for m in found.curves[car] if m.neutral]
        least = min(m.fuel_percent for m in neutral)
        near = [m.nox_percent for m in neutral if m.fuel_percent <= least + _NEAR_LEAST_FUEL]
        spreads.append(f"{car} {signed(min(near))} to {signed(max(near))} %")
    return (
        "Among the neutral members of the curve in section 2 that burn at most "
        f"{_NEAR_LEAST_FUEL:g} points more than the best, NOx is anywhere in: "
        f"{'; '.join(spreads)}."
    )


def _trade_off(found: Reproduction) -> str:
    """What the whole family of nox_cut can do, against conventional."""
    rows = []
    for cut in CUTS_PERCENT:
        penalties = [least_penalty(found.families[car], cut) for car in HYBRIDS]
        rows.append([f"{cut:g}", *("-" if p is None else signed(p) for p in penalties)])
    heads = ["NOx cut by at least, %", *(f"{car} fuel, %" for car in HYBRIDS)]
    text = (
        "The least that the family's neutral members, as shipped, change fuel against "
        "`conventional` for a cut of NOx against it (-: none cuts so much). The penalty follows "
        "from how far one cuts:"
    )
    return text + "\n\n" + markdown(heads, "r" * len(heads), rows)
