"""One section for each difference: what moves it and by how much, and the verdict."""

from collections.abc import Sequence

from hevopt.car_files.load import load_architecture
from hevopt.reproduction import variations as v
from hevopt.reproduction.cases import K_AND_STEEP, LOSSES, VARIATIONS_OF_B, Reproduction, Under
from hevopt.reproduction.details import balances, curves, nox_spread, trade_off
from hevopt.reproduction.published import MEAN_NOX_WITHOUT_C1, STATEMENTS, Statement
from hevopt.reproduction.verdicts import applies, markdown, signed, star, starred, verdict

TITLES = (
    "1. Fuel of B",
    "2. Fuel of C2 and D, conventional",
    "3. NOx of B",
    "4. NOx of the hybrids, conventional",
    "5. NOx cut",
    "6. Energy at the wheels",
)
_LOSSES_ALL = (
    v.DRIVELINE, v.MACHINE_LOSS, v.CHARGING_LOSS, v.CELLS, v.EACH_WAY, v.RESISTANCE, v.HYBRID_MASS,
    v.AUXILIARIES, v.ROAD, LOSSES,
)  # fmt: skip
_BRAKING = (*v.ELECTRIC, v.ALL_BRAKING, *v.BRAKING, v.NO_RECOVERY)
_ENGINE = (v.FREE_STARTS, v.DEAR_STARTS, v.NO_INERTIA, v.NO_GAP)
# What each section with statements varies.
VARIATIONS_OF = (
    (v.K_PHASES, *_ENGINE, v.ALTERNATOR, *VARIATIONS_OF_B, *_LOSSES_ALL),
    (*_BRAKING, v.K_PHASES, *_ENGINE, v.ALTERNATOR, *_LOSSES_ALL),
    (v.STEEP_NOX, v.K_PHASES, K_AND_STEEP, *_ENGINE, v.ALTERNATOR, *VARIATIONS_OF_B, *_LOSSES_ALL),
    (v.STEEP_NOX, v.K_PHASES, K_AND_STEEP, *_BRAKING, *_ENGINE, v.ALTERNATOR, *_LOSSES_ALL),
    (v.STEEP_NOX, v.K_PHASES, *_BRAKING, *_ENGINE, v.ALTERNATOR, *_LOSSES_ALL),
)
# What moves no figure by so many points is named, not tabulated.
_NOTHING = 0.05


def anchor(section: int) -> str:
    """Where a link to a section goes: its heading as Markdown viewers name it."""
    kept = "".join(c for c in TITLES[section].lower() if c.isalnum() or c == " ")
    return "#" + kept.replace(" ", "-")


def fuel_of_b(found: Reproduction) -> str:
    """Section 1."""
    b = load_architecture("B")
    machine, battery = v.machine_efficiency(b), b.battery.coulombic_efficiency
    losses = [
        f"x {factor:g} makes them {v.less_loss(machine, factor):g} and "
        f"{v.less_loss(battery, factor):g}"
        for factor in (v.LOSS_FACTOR, v.LESS_LOSS_FACTOR)
    ]
    return _section(
        0, found,
        "B saves what the engine burns at standstill. In the study it rests there, but not while "
        "a gear is being engaged before moving off. Ours keeps it turning wherever the cycle's "
        "gear column has a gear engaged at standstill, the K phases, the long one before the "
        "extra-urban part included. A's alternator is less efficient than B's machine: that is "
        f"part of the gain. B's own losses are an efficiency of its machine, {machine:g}, and of "
        f"charging its battery, {battery:g}: loss {losses[0]}, {losses[1]}. A's alternator keeps "
        "its own.",
    )  # fmt: skip


def fuel_of_hybrids(found: Reproduction) -> str:
    """Section 2."""
    text = (
        "The study drives electrically above some charge up to some power or speed and gives none of "
        "them. Ours takes the three that together burn least. Ours brakes with the machine by a "
        "share over speed, from none at standstill to 0.8 at 97 km/h; the friction brakes take the "
        "rest. What the study lets its machine take is not in its text. The inertia of engine and "
        "machine is charged on their own shafts, in A and in the hybrids alike; a start spins the "
        "engine up from the battery, a stop and a change up lose what its shaft holds. A change of "
        "gear of the manual gearbox leaves half a second without torque. The battery's round trip "
        "is the study's 0.9."
    )
    return "\n\n".join([_section(1, found, text), balances(found), curves(found)])


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
    return _section(3, found, text) + "\n\n" + nox_spread(found)


def nox_cut(found: Reproduction) -> str:
    """Section 5."""
    text = (
        "The study does not say how far it cuts; ours takes the family's member of least NOx, "
        "whatever it costs in fuel, and measures it against a `conventional` whose NOx is left "
        "to chance (section 4)."
    )
    return _section(4, found, text) + "\n\n" + trade_off(found)


def others_of(section: int, found: Reproduction) -> list[Under]:
    """The study under each variation of a section."""
    return [found.others[variation.name] for variation in VARIATIONS_OF[section]]


def _section(section: int, found: Reproduction, text: str) -> str:
    """Text, a table of what each variation moves, and a verdict for each statement of the section."""
    statements = _statements(section)
    others = others_of(section, found)
    foreign = [u for u in others if not any(applies(u, s) for s in statements)]
    # A sum of changes is always listed with its parts: they may cancel in it.
    idle = [
        u
        for u in others
        if u not in foreign and u.name != LOSSES.name and not _moves(u, found.shipped, statements)
    ]
    shown = [found.shipped, *(u for u in others if u not in foreign and u not in idle)]
    heads = ["what is another", "A, l/100 km"]
    for statement in statements:
        heads += [f"{statement.what}, %", "moved by"]
    rows = [_line(under, found.shipped, statements) for under in shown]
    rows.append(["*published*", "", *(cell for s in statements for cell in (s.published, ""))])
    parts = [f"## {TITLES[section]}", text, markdown(heads, "lr" + "rr" * len(statements), rows)]
    if idle:
        parts.append(f"Moving nothing by {_NOTHING:g} points: {_names(idle)}.")
    if foreign:
        parts.append(
            f"Does not apply, as it changes nothing in the model of these cars: {_names(foreign)}."
        )
    parts += [table] if (table := starred(shown, statements)) else []
    parts.append("\n".join(f"- {s.what}: {verdict(s, found, others)}" for s in statements))
    return "\n\n".join(parts)


def _statements(section: int) -> list[Statement]:
    return [s for s in (*STATEMENTS, MEAN_NOX_WITHOUT_C1) if s.section - 1 == section]


def _names(unders: Sequence[Under]) -> str:
    return "; ".join(under.name for under in unders)


def _moves(under: Under, shipped: Under, statements: Sequence[Statement]) -> bool:
    moved = [s.ours(under.cases) - s.ours(shipped.cases) for s in statements]
    return any(abs(points) >= _NOTHING for points in moved)


def _line(under: Under, shipped: Under, statements: Sequence[Statement]) -> list[str]:
    cells = [under.name, f"{under.cases['A', 'baseline'].fuel_l_per_100km:.3f}"]
    for statement in statements:
        if under is not shipped and not applies(under, statement):
            cells += ["does not apply", ""]
            continue
        value = statement.ours(under.cases)
        moved = "" if under is shipped else signed(value - statement.ours(shipped.cases))
        cells += [signed(value) + star(under, statement), moved]
    return cells
