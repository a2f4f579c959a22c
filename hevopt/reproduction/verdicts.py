"""What brings ours to a published figure, and what is left where nothing does; and tables in Markdown."""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from hevopt.published import STATEMENTS, Statement
from hevopt.reproduction.cases import Member, Reproduction, Under

# Statements that a milder cut may meet: (car, figure of the member), by their text.
_OF_FAMILY = {
    STATEMENTS[5].what: ("E", "fuel_percent"),
    STATEMENTS[6].what: ("D", "fuel_percent"),
    STATEMENTS[7].what: ("E", "nox_percent"),
}
_STRATEGIES = ("start_stop", "conventional", "nox_cut")


class _Value(NamedTuple):
    """A statement under a variation, per cent; driven: as driven; star: "*" where a case is not neutral."""

    name: str
    value: float
    driven: float
    star: str


class _Sorted(NamedTuple):
    """Values that reach what is published and that pass it; only_corrected: as driven they do not."""

    values: list[_Value]
    reached: list[_Value]
    passed: list[_Value]
    reached_only_corrected: list[_Value]
    passed_only_corrected: list[_Value]


def points_off(statement: Statement, ours: float) -> float:
    """Points by which ours lies outside what is published; 0 within its rounding."""
    if ours > statement.high + statement.rounding:
        return ours - statement.high
    return ours - statement.low if ours < statement.low - statement.rounding else 0.0


def off_text(statement: Statement, ours: float) -> str:
    """The same in words."""
    off = points_off(statement, ours)
    return f"{signed(off)} points" if off else "within rounding"


def cases_in(statement: Statement) -> list[tuple[str, str]]:
    """The cases that a statement speaks of, without A."""
    return [(car, name) for car in statement.cars for name in _STRATEGIES if name in statement.what]


def applies(under: Under, statement: Statement) -> bool:
    """Whether the variation changes anything in a car that the statement is worked out from."""
    against_a = "over" not in statement.what
    return not {*statement.cars, *(["A"] if against_a else [])} <= under.untouched


def driven(under: Under, statement: Statement) -> float:
    """The statement as driven where a case of it is not neutral, otherwise as it is."""
    return statement.ours(under.driven if star(under, statement) else under.cases)


def verdict(statement: Statement, found: Reproduction, others: Iterable[Under]) -> str:
    """Which variations bring ours to what is published, or what is left unexplained."""
    off = points_off(statement, statement.ours(found.shipped.cases))
    if not off:
        return "ours is what is published, to its rounding."
    by = _sorted(statement, found, others)
    parts = (
        ("Reached with", by.reached),
        ("Passed with", by.passed),
        ("Reached only after correction with", by.reached_only_corrected),
        ("Passed only after correction with", by.passed_only_corrected),
    )
    text = f"{signed(off)} points off."
    text += "".join(f" {how}: {'; '.join(map(_shown, of))}." for how, of in parts if of)
    milder = _milder(statement, found.families)
    if milder or any(of for _, of in parts):
        return text + milder
    closest = min(by.values, key=lambda value: abs(points_off(statement, value.value)))
    left = signed(points_off(statement, closest.value))
    return f"{text} Not explained: the closest, {_shown(closest)}, leaves {left} points."


def standing(statement: Statement, found: Reproduction, others: Iterable[Under]) -> str:
    """The verdict in a few words."""
    if not points_off(statement, statement.ours(found.shipped.cases)):
        return "agrees"
    by = _sorted(statement, found, others)
    if by.reached:
        return "reached by a variation"
    if _milder(statement, found.families):
        return "reached by a milder cut"
    passed = "passed by a variation" if by.passed else ""
    if not passed and by.passed_only_corrected:
        passed = "passed only after correction"
    reached = "reached only after correction" if by.reached_only_corrected else ""
    return ", ".join(text for text in (reached, passed) if text) or "**not explained**"


def _sorted(statement: Statement, found: Reproduction, others: Iterable[Under]) -> _Sorted:
    off = points_off(statement, statement.ours(found.shipped.cases))
    values = [
        _Value(
            under.name,
            statement.ours(under.cases),
            driven(under, statement),
            star(under, statement),
        )
        for under in others
        if applies(under, statement)
    ]

    def reaches(value: float) -> bool:
        return not points_off(statement, value)

    def passes(value: float) -> bool:
        return points_off(statement, value) * off < 0

    reached = [v for v in values if reaches(v.value)]
    passed = [v for v in values if passes(v.value)]
    return _Sorted(
        values,
        [v for v in reached if reaches(v.driven)],
        [v for v in passed if passes(v.driven)],
        [v for v in reached if not reaches(v.driven)],
        [v for v in passed if not passes(v.driven)],
    )


def _shown(value: _Value) -> str:
    as_driven = f", as driven {signed(value.driven)} %" if value.driven != value.value else ""
    return f"{value.name} ({signed(value.value)} %{value.star}{as_driven})"


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
    return "*" if any(case in under.surplus_percent for case in cases_in(statement)) else ""


def starred(unders: Iterable[Under], statements: Iterable[Statement]) -> str:
    """A table of what the stars stand for: how far the end charge is off, and ours as driven; "" without any."""
    rows = []
    pairs = ((u, s) for u in unders for s in statements if star(u, s) and applies(u, s))
    for under, statement in pairs:
        sizes = "; ".join(
            f"{' '.join(case)} {signed(under.surplus_percent[case])}"
            for case in cases_in(statement)
            if case in under.surplus_percent
        )
        values = (statement.ours(under.cases), driven(under, statement))
        rows.append([under.name, statement.what, sizes, *(signed(value) for value in values)])
    if not rows:
        return ""
    heads = ["starred under", "point", "end charge off, % of the fuel's energy", "as above, %",
             "as driven, %"]  # fmt: skip
    return markdown(heads, "lllrr", rows)


def signed(value: float, digits: int = 1) -> str:
    """With its sign, but for what rounds to 0."""
    rounded = round(value, digits)
    return f"{rounded:+.{digits}f}" if rounded else f"{0:.{digits}f}"


def markdown(heads: Sequence[str], align: str, rows: Iterable[Sequence[str]]) -> str:
    """A table; align: l or r for each column."""
    rule = ["---:" if a == "r" else "---" for a in align]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in [heads, rule, *rows])
