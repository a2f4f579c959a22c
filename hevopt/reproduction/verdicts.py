"""What brings ours to a published figure, and what is left where nothing does; and tables in Markdown."""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from hevopt.reproduction.cases import Reproduction, Under
from hevopt.reproduction.members import Member
from hevopt.reproduction.published import STATEMENTS, Statement

# In place of NOx as driven.
_NOT_CORRECTED = "not corrected"


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


def applies(under: Under, statement: Statement) -> bool:
    """Whether the variation changes anything in a car that the statement is worked out from."""
    against_a = statement.over is None
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
    if _meeting([statement], found.families):
        both = _meeting(_of_one_family(statement), found.families)
        return "reached by a milder cut" + ("" if both else ", which misses the car's other point")
    passed = "lies between ours and a variation's" if by.passed else ""
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
    meeting = _meeting([statement], families)
    if not meeting:
        return ""
    fuel, nox = ([getattr(m, name) for m in meeting] for name in ("fuel_percent", "nox_percent"))
    return (
        f" Reached by milder cuts: {len(meeting)} of the family's {len(_neutral(statement, families))} neutral "
        f"members, which change fuel by {_range(fuel)} % and NOx by {_range(nox)} %."
        f"{_at_once(statement, families)}"
    )


def _at_once(statement: Statement, families: Mapping[str, Sequence[Member]]) -> str:
    """How many members meet every point of the statement's car, and the nearest where none does."""
    points = _of_one_family(statement)
    if len(points) == 1:
        return ""
    meeting = _meeting(points, families)
    text = (
        f" Members that reach every point of {statement.cars[0]} at once: {len(meeting) or 'none'}"
    )
    if meeting:
        return f"{text}."
    near = min(_neutral(statement, families), key=lambda m: max(_beyond(s, m) for s in points))
    changes = f"fuel by {signed(near.fuel_percent)} % and NOx by {signed(near.nox_percent)} %"
    return f"{text}; the nearest changes {changes}."


def _of_one_family(statement: Statement) -> list[Statement]:
    """The statements that a milder cut on the same car may meet.

    "No gain" is none of them: it says that no cut brings any, which a cut that does little cannot show.
    """
    return [s for s in STATEMENTS if s.cars == statement.cars and s.over and s.low != 0]


def _meeting(
    statements: Sequence[Statement], families: Mapping[str, Sequence[Member]]
) -> list[Member]:
    """The neutral members of nox_cut that meet all of some statements on one car; [] where it may meet none."""
    if any(s not in _of_one_family(s) for s in statements):
        return []
    neutral = _neutral(statements[0], families)
    return [m for m in neutral if all(not points_off(s, _change(s, m)) for s in statements)]


def _neutral(statement: Statement, families: Mapping[str, Sequence[Member]]) -> list[Member]:
    return [m for m in families[statement.cars[0]] if m.neutral]


def _change(statement: Statement, member: Member) -> float:
    return (member.fuel_percent, member.nox_percent)[statement.figure]


def _beyond(statement: Statement, member: Member) -> float:
    """Points beyond the rounding of what is published."""
    return max(abs(points_off(statement, _change(statement, member))) - statement.rounding, 0.0)


def _range(values: Sequence[float]) -> str:
    ends = signed(min(values)), signed(max(values))
    return ends[0] if ends[0] == ends[1] else " to ".join(ends)


def star(under: Under, statement: Statement) -> str:
    """A star where a case that the statement speaks of is not neutral."""
    return "*" if any(case in under.surplus_percent for case in statement.cases) else ""


def starred(unders: Iterable[Under], statements: Iterable[Statement]) -> str:
    """A table of what the stars stand for: how far the end charge is off, and ours as driven; "" without any."""
    rows = []
    pairs = ((u, s) for u in unders for s in statements if star(u, s) and applies(u, s))
    for under, statement in pairs:
        sizes = "; ".join(
            f"{' '.join(case)} {signed(under.surplus_percent[case])}"
            for case in statement.cases
            if case in under.surplus_percent
        )
        as_driven = _NOT_CORRECTED if statement.figure else signed(driven(under, statement))
        above = signed(statement.ours(under.cases))
        rows.append([under.name, statement.what, sizes, above, as_driven])
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
