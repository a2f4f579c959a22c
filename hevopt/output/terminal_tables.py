"""The table of a comparison for the terminal, and the notes below it."""

from collections.abc import Callable, Collection, Sequence
from typing import Literal, NamedTuple

from rich.table import Table
from rich.text import Text

from hevopt.bounds.claim import PROOF_WORDS, SCOPE_WORDS
from hevopt.files.shown import printable
from hevopt.output.tables import needed_width, titled_table
from hevopt.studies.comparison import Comparison
from hevopt.studies.rows import Row, end_asked_text, marked, no_reference_text

_CAUSAL_MARK = "†"


class _Column(NamedTuple):
    """A column of a comparison: head, what a row says in it, and when it leaves a narrow terminal, 0 never.

    of: what goes before the head where that alone does not tell the column
    engines: whether it says nothing of cars that have none
    """

    head: str
    cell: Callable[[Row], str]
    leaves: int
    justify: Literal["left", "right"] = "right"
    of: str = ""
    engines: bool = False


def _number(name: str, form: str) -> Callable[[Row], str]:
    def cell(row: Row) -> str:
        value = getattr(row, name)
        return "-" if value is None else format(0.0 if abs(value) < 5e-7 else value, form)

    return cell


def _charge(row: Row) -> str:
    if row.soc_end is None or row.soc_start is None:
        return "-"
    change = row.soc_end - row.soc_start
    return format(0.0 if abs(change) < 5e-7 else change, "+.4f")


# The higher, the sooner it leaves.
_COLUMNS = (
    _Column("fuel\nl/100km", _number("fuel_l_per_100km", ".3f"), 0, engines=True),
    _Column("vs ref\n%", _number("delta_fuel_percent", "+.1f"), 1, engines=True),
    _Column("CO2\ng/km", _number("co2_g_per_km", ".1f"), 8, engines=True),
    _Column("NOx\nmg/km", _number("nox_mg_per_km", ".0f"), 5, engines=True),
    _Column("vs ref\n%", _number("delta_nox_percent", "+.1f"), 9, of="NOx ", engines=True),
    _Column("ΔSOC", _charge, 7),
    _Column("ΔE/fuel\n%", _number("delta_energy_percent", "+.2f"), 4, engines=True),
    _Column("corrected\nl/100km", _number("fuel_corrected_l_per_100km", ".3f"), 3, engines=True),
    _Column(
        "starts",
        lambda row: "-" if row.engine_starts is None else str(row.engine_starts),
        6,
        engines=True,
    ),
    _Column("bound\nl/100km", _number("bound_l_per_100km", ".3f"), 2, engines=True),
    _Column("gap\n%", _number("gap_percent", ".3f"), 0),
    _Column(
        "proof",
        lambda row: "-" if row.certificate is None else str(row.certificate.proof),
        10,
        "left",
    ),
    _Column("s", _number("solve_s", ".2f"), 11),
)
# Only where another end charge than the start's is asked; before the corrected fuel.
_BATTERY = _Column("battery\nkWh/100km", _number("electricity_kwh_per_100km", "z.2f"), 0)
_BATTERY_PLACE = 7


def comparison_table(comparison: Comparison, width: int | None = None) -> Table:
    """The rows as a table for the terminal.

    Columns that decide less leave until it is no wider than `width`, and of a failure there is one word, as its
    message is printed apart.
    """
    columns = [*_columns(comparison), *_forward_columns(comparison)]
    if width is None or needed_width(_table(comparison, columns)) <= width:
        return _table(comparison, columns)
    leaving = sorted(columns, key=lambda column: column.leaves)
    while leaving[-1].leaves and needed_width(_table(comparison, columns, brief=True)) > width:
        columns.remove(leaving.pop())
    return _table(comparison, columns, brief=True)


def _columns(comparison: Comparison) -> list[_Column]:
    """The columns of a wide table, those of the forward runs apart."""
    if _electric(comparison):
        return [_BATTERY, *(column for column in _COLUMNS if not column.engines)]
    columns = list(_COLUMNS)
    if comparison.end_asked:
        columns.insert(_BATTERY_PLACE, _BATTERY)
    return columns


def _electric(comparison: Comparison) -> bool:
    """Whether no car of it has an engine."""
    solved = [row for row in comparison.rows if row.solved]
    return bool(solved) and all(row.electric for row in solved)


def _forward_columns(comparison: Comparison) -> list[_Column]:
    """What every row does when it is driven forward, where that was asked for."""

    def of(name: str, form: str) -> Callable[[Row], str]:
        def cell(row: Row) -> str:
            found = comparison.forward.get((row.architecture, row.strategy))
            value = None if found is None else getattr(found, name)
            return "-" if value is None else format(value, form)

        return cell

    columns = [
        _Column("driven\nl/100km", of("corrected_l_per_100km", ".3f"), 0),
        _Column("against\n%", of("change_percent", "+.2f"), 0),
        _Column("RMSSE\nkm/h", of("rmsse_kmh", ".2f"), 0),
        _Column("missed\n", of("violations", "d"), 0),
    ]
    return columns if comparison.forward else []


def left_out(comparison: Comparison, table: Table) -> list[str]:
    """Heads of the columns that have left a comparison's table."""
    shown = [str(column.header) for column in table.columns]
    names = []
    for column in _columns(comparison):
        if column.head in shown:
            shown.remove(column.head)
        else:
            names.append(column.of + column.head.partition("\n")[0])
    return names


def _table(comparison: Comparison, columns: Sequence[_Column], *, brief: bool = False) -> Table:
    table = titled_table(f"cycle {comparison.cycle}")
    for name in ("car", "strategy"):
        table.add_column(name, no_wrap=True)
    for column in columns:
        table.add_column(column.head, justify=column.justify, no_wrap=True)
    table.add_column("status", no_wrap=True)
    ok = [row for row in comparison.rows if row.status.ok and row.fuel_corrected_l_per_100km]
    best = min(ok, key=lambda row: row.fuel_corrected_l_per_100km or 0.0, default=None)
    previous = None
    for row in comparison.rows:
        if previous not in (None, row.architecture):
            table.add_section()
        previous = row.architecture
        mark = _CAUSAL_MARK if row.strategy in comparison.causal else ""
        cells = [row.architecture, row.strategy + mark, *(column.cell(row) for column in columns)]
        style = "bold green" if row is best and len(comparison.rows) > 1 else ""
        told = "failed" if brief and row.status.failure else str(row.status)
        status = Text(told, style="" if row.status.ok else "yellow")
        # Text, because a name such as "[red]" would be markup in a string.
        table.add_row(*map(Text, cells), status, style=style)
    return table


def comparison_notes(comparison: Comparison, left: Collection[str] = ()) -> str:
    """What the columns mean, below the table; left: heads of those that have left it."""
    return (
        f"{_electric_notes(comparison) if _electric(comparison) else _fuel_notes(comparison)}"
        f"{_scope_note(comparison)}"
        f"{_causal_note(comparison)}"
        f"{'' if 'proof' in left else _proof_note(comparison)}"
        f"{_foot(comparison)}"
        f"{_nox_note(comparison)}"
        f"{_lost_note(comparison)}"
        f"{_forward_note(comparison)}"
    )


def _fuel_notes(comparison: Comparison) -> str:
    """Columns of cars that burn fuel."""
    objective = "fuel"
    if comparison.nox_weight:
        objective = f"fuel + {comparison.nox_weight:g} x NOx (in kg), as fuel volume"
    return (
        f"vs ref: against {_reference(comparison)}. corrected: fuel less what the end charge is worth "
        "(multiplier of the dual).\n"
        f"{_end_notes(comparison)}"
        f"bound: no plan with that row's end charge has less {objective}; gap: how far the row is above it.\n"
    )


def _electric_notes(comparison: Comparison) -> str:
    """Columns where no car has an engine."""
    asked = end_asked_text(comparison.end_asked)
    return (
        "battery: stored energy that the drive takes, start less end; gap: how far what the battery gives is above "
        "a bound that no plan is below.\n"
        + (f"end charge asked, other than the start's: {asked}.\n" if comparison.end_asked else "")
    )


def _foot(comparison: Comparison) -> str:
    """What all figures hold for."""
    if _electric(comparison):
        return "Figures are of this cycle alone."
    gears = f"as {comparison.cycle} lists them, else by the car's own shift speeds"
    if comparison.free_gear:
        gears = "chosen with the plan"
    return f"The engine is warm from start to end; gears: {gears}; figures are of this cycle alone."


def _forward_note(comparison: Comparison) -> str:
    """What the forward columns are, and what is to be known of each run beside them."""
    if not comparison.forward:
        return ""
    told = [
        f"\n{printable(car)} {printable(strategy)}, driven: {printable(found.status)}"
        for (car, strategy), found in comparison.forward.items()
        if found.status != "ok"
    ]
    return (
        "\ndriven: forward by a driver at the pedals, charge-corrected; against: the row's own corrected fuel, "
        "without an engine its energy from the battery; "
        "missed: times that the trace was left." + "".join(told)
    )


def _scope_note(comparison: Comparison) -> str:
    """Of what the bounds speak, car by car where they differ."""
    cars: dict[str, list[str]] = {}
    for row in comparison.rows:
        if row.certificate is not None:
            named = cars.setdefault(str(row.certificate.scope), [])
            named += [] if row.architecture in named else [row.architecture]
    texts = [
        ", ".join(filter(None, (scope, SCOPE_WORDS.get(scope))))
        + (f": {', '.join(map(printable, names))}" if len(cars) > 1 else "")
        for scope, names in cars.items()
    ]
    return f"scope of the bounds: {'; '.join(texts)}\n" if texts else ""


def _proof_note(comparison: Comparison) -> str:
    """What the kinds of proof are that rows name."""
    named = {row.certificate.proof for row in comparison.rows if row.certificate is not None}
    words = [f"{proof} = {word}" for proof, word in PROOF_WORDS.items() if proof in named]
    return f"proof: {'; '.join(words)}.\n" if words else ""


def _reference(comparison: Comparison) -> str:
    """The row that the others are compared with, and what is to be known of it."""
    for row in comparison.rows:
        if f"{row.architecture} {row.strategy}" == comparison.reference:
            return f"{comparison.reference}{marked(row.status)}"
    return no_reference_text(comparison.rows)


def _end_notes(comparison: Comparison) -> str:
    """What is asked of the end charge, where that is not the start's."""
    if not comparison.end_asked:
        return ""
    return (
        f"end charge asked, other than the start's: {end_asked_text(comparison.end_asked)}. "
        "ΔE/fuel and corrected count only what is left beyond it;\n"
        "electricity drawn from the battery down to it (or stored up to it) is the column battery, from start to "
        "end; it is not counted as fuel, nor in vs ref.\n"
    )


def _causal_note(comparison: Comparison) -> str:
    """What the mark says, where a row has it, and why rows that claim to be causal have not."""
    marked = any(row.strategy in comparison.causal for row in comparison.rows)
    note = f"{_CAUSAL_MARK}: causal, decides without knowing the rest of the cycle.\n"
    return (note if marked else "") + "".join(
        f"not causal, {printable(f'{row}: {why}')}.\n"
        for row, why in comparison.peeking_by_row.items()
    )


def _lost_note(comparison: Comparison) -> str:
    lost = comparison.lost_proofs.items()
    return "".join(f"\nproof not found: {printable(f'{which}: {why}')}" for which, why in lost)


def _nox_note(comparison: Comparison) -> str:
    rows = comparison.rows
    unknown = [r for r in rows if r.nox_mg_per_km is None and r.solved and not r.electric]
    if not unknown:
        return ""
    cars = ", ".join(dict.fromkeys(printable(row.architecture) for row in unknown))
    return f"\nNOx is unknown for {cars}, whose engine has no data on it."
