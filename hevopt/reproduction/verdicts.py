"""What brings ours to a published figure, and what is left where nothing does; and tables in Markdown."""

from collections.abc import Iterable, Mapping, Sequence

from hevopt.published import STATEMENTS, Statement
from hevopt.reproduction.cases import Member, Reproduction, Under

# Statements that a milder cut may meet: (car, figure of the member), by their text.
_OF_FAMILY = {
    STATEMENTS[5].what: ("E", "fuel_percent"),
    STATEMENTS[6].what: ("D", "fuel_percent"),
    STATEMENTS[7].what: ("E", "nox_percent"),
}


_Value = tuple[str, float]


def points_off(statement: Statement, ours: float) -> float:
    """Points by which ours lies outside what is published; 0 within its rounding."""
    if ours > statement.high + statement.rounding:
        return ours - statement.high
    return ours - statement.low if ours < statement.low - statement.rounding else 0.0


def off_text(statement: Statement, ours: float) -> str:
    """The same in words."""
    off = points_off(statement, ours)
    return f"{signed(off)} points" if off else "within rounding"


def verdict(statement: Statement, found: Reproduction, others: Iterable[Under]) -> str:
    """Which variations bring ours to what is published, or what is left unexplained."""
    off = points_off(statement, statement.ours(found.shipped.cases))
    if not off:
        return "ours is what is published, to its rounding."
    values, reached, passed = _sorted(statement, found, others)
    text = f"{signed(off)} points off."
    text += f" Reached with: {_listed(reached)}." if reached else ""
    text += f" Passed with: {_listed(passed)}." if passed else ""
    milder = _milder(statement, found.families)
    if reached or passed or milder:
        return text + milder
    name, value = min(values, key=lambda pair: abs(points_off(statement, pair[1])))
    left = signed(points_off(statement, value))
    return f"{text} Not explained: the closest, {name}, gives {signed(value)} % and leaves {left} points."


def standing(statement: Statement, found: Reproduction, others: Iterable[Under]) -> str:
    """The verdict in a word or two."""
    if not points_off(statement, statement.ours(found.shipped.cases)):
        return "agrees"
    _, reached, passed = _sorted(statement, found, others)
    if reached:
        return "reached by a variation"
    if _milder(statement, found.families):
        return "reached by a milder cut"
    return "passed by a variation" if passed else "**not explained**"


def _sorted(
    statement: Statement, found: Reproduction, others: Iterable[Under]
) -> tuple[list[_Value], list[_Value], list[_Value]]:
    """Name and value under each variation: all, those that reach the published figure, those that pass it."""
    off = points_off(statement, statement.ours(found.shipped.cases))
    values = [(under.name, statement.ours(under.cases)) for under in others]
    reached = [pair for pair in values if not points_off(statement, pair[1])]
    passed = [pair for pair in values if points_off(statement, pair[1]) * off < 0]
    return values, reached, passed


def _listed(values: Sequence[_Value]) -> str:
    return "; ".join(f"{name} ({signed(value)} %)" for name, value in values)


def _milder(statement: Statement, families: Mapping[str, Sequence[Member]]) -> str:
    """Which neutral members of nox_cut, as shipped but for how far it cuts, meet the statement."""
    if statement.what not in _OF_FAMILY:
        return ""
    car, figure = _OF_FAMILY[statement.what]
    neutral = [m for m in families[car] if m.neutral]
    meeting = [m for m in neutral if not points_off(statement, getattr(m, figure))]
    if not meeting:
        return ""
    fuel, nox = ([getattr(m, name) for m in meeting] for name in ("fuel_percent", "nox_percent"))
    return (
        f" Reached by milder cuts: {len(meeting)} of the family's {len(neutral)} neutral members, "
        f"which change fuel by {_range(fuel)} % and NOx by {_range(nox)} %."
    )


def _range(values: Sequence[float]) -> str:
    ends = signed(min(values)), signed(max(values))
    return ends[0] if ends[0] == ends[1] else " to ".join(ends)


def star(under: Under, statement: Statement) -> str:
    """A star where a case that the statement speaks of is not neutral."""
    names = ("conventional", "nox_cut") if "over" in statement.what else ("conventional",)
    off = any((car, name) in under.off for car in statement.cars for name in names)
    return "*" if off else ""


def signed(value: float, digits: int = 1) -> str:
    """With its sign, but for what rounds to 0."""
    rounded = round(value, digits)
    return f"{rounded:+.{digits}f}" if rounded else f"{0:.{digits}f}"


def markdown(heads: Sequence[str], align: str, rows: Iterable[Sequence[str]]) -> str:
    """A table; align: l or r for each column."""
    rule = ["---:" if a == "r" else "---" for a in align]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in [heads, rule, *rows])
