"""What the header of a measured file says: names, units, and the conventions of tools that leave units out."""

import re
from collections.abc import Collection

from hevopt.driving.cycle import COLUMNS as CYCLE_COLUMNS
from hevopt.files.shown import printable
from hevopt.units import unit_named

# A unit of time that is none: hours, minutes and seconds in one number, with or without parts of a second.
PACKED_CLOCK = "hhmmss"
_NAME_MAX = 80
_BRACKETS = re.compile(r"(.*?)[\s_]*(?:\[([^\[\]]*)\]|\(([^()]*)\)|\{([^{}]*)\})")
_SLASHED = re.compile(r"(.+?)\s+/\s*(\S+)|([^\s/]+)/(\S+/\S+|rpm|min-1|%|N·?m)")
_WORDS = re.compile(r"(.+?)(,\s*|\s+in\s+|\s+)(\S+)")
# The structure of a field, as in `cycle.time`.
_FIELD = re.compile(r"^[A-Za-z]\w*\.(?=[A-Za-z]\w*$)")
# "gps" means g/s after these alone; elsewhere it names the satellites.
_FLOWS = re.compile(r"fuel|nox|co|hc|pm|flow|mass", re.IGNORECASE)
_FASTSIM = {"cycSecs": "s", "cycMps": "m/s", "cycGrade": "fraction"}
_FASTSIM_SPEEDS = {"cycMps", "mps", "speed_meters_per_second"}
_VECTO = {
    "<s>": "m", "<t>": "s", "<v>": "km/h", "<grad>": "%", "<stop>": "s", "<n>": "rpm",
    "<gear>": "fraction",
}  # fmt: skip


def cleaned(text: str) -> str:
    """A header cell as a name: on one line, printable, not too long."""
    return printable(" ".join(text.split()).strip("\ufeff"))[:_NAME_MAX]


def unit_in_cell(text: str) -> str | None:
    """The unit that a cell of a units row names; '' for an empty one, None where the cell is something else."""
    inner = text.strip()
    if len(inner) > 1 and inner[0] + inner[-1] in ("[]", "()", "{}"):
        return inner[1:-1].strip() or "-"
    # Written small, volts and amperes are names: speed, acceleration.
    return inner if not inner or (unit_named(inner) and inner not in ("v", "a", "k")) else None


def unit_in_name(name: str) -> tuple[str | None, str]:
    """The unit that a column's name carries and how; (None, '') without one.

    Known: `v [km/h]`, `v (km/h)`, `v / km/h`, `v in km/h`, `v, km/h`, `v km/h`, `v_kmh`, `v_km_h` and `mps` alone.
    """
    if match := _BRACKETS.fullmatch(name):
        square, *others = match.group(2, 3, 4)
        if square is not None:
            return square.strip() or "-", "header"
        inner = next(text for text in others if text is not None).strip()
        return (inner, "header") if unit_named(inner) else (None, "")
    if match := _SLASHED.fullmatch(name):
        inner = (match[2] or match[4]).strip("()")
        if unit_named(inner):
            return inner, "header"
    if match := _WORDS.fullmatch(name):
        if unit_named(match[3]) and (match[2].strip() or len(match[3]) > 1):
            return match[3], "header"
    if suffix := _suffix(name):
        return suffix[1], "suffix of the name"
    if len(name) > 1 and name.lower() != "min" and unit_named(name):
        return name, "the name is a unit"
    return None, ""


def _suffix(name: str) -> tuple[str, str] | None:
    parts = name.split("_")
    for count in (3, 2, 1):
        if len(parts) > count and parts[-1][:1].isalpha():
            rest, tail = "_".join(parts[:-count]), parts[-count:]
            if tail == ["gps"] and _FLOWS.search(rest):
                return rest, "g/s"
            for joint in ("/", ""):
                if unit := unit_named(joint.join(tail)):
                    return rest, unit.symbol
    return None


def units_in_name(name: str) -> list[tuple[str, str]]:
    """Every known unit that a name states and how, as `speed_kmh [m/s]` two; the one that counts first."""
    match = _BRACKETS.fullmatch(name)
    stated = [unit_in_name(name), *([unit_in_name(match[1])] if match else [])]
    return [(unit, how) for unit, how in stated if unit and unit_named(unit)]


def grade_ends_step(name: str, names: Collection[str]) -> bool:
    """Whether a row's grade in this column holds over the step that ends at the row, as FASTSim's do."""
    return name == "cycGrade" or (name == "grade" and not _FASTSIM_SPEEDS.isdisjoint(names))


def base_of(name: str) -> str:
    """A name without its unit, in lower-case letters and digits, so that aliases can be compared."""
    if unit_in_name(name)[1] == "suffix of the name":
        name = _suffix(name)[0]
    elif match := _BRACKETS.fullmatch(name):
        name = match[1] if match[2] is not None or unit_in_name(name)[0] else name
    elif (match := _SLASHED.fullmatch(name)) and unit_named((match[2] or match[4]).strip("()")):
        name = match[1] or match[3]
    elif (match := _WORDS.fullmatch(name)) and unit_in_name(name)[0]:
        name = match[1]
    name = _FIELD.sub("", name)
    return re.sub(r"[\W_]", "", name.lower())


def unit_by_convention(names: list[str], vecto: bool = False) -> dict[str, tuple[str, str]]:
    """Units that a tool's own column names imply: name -> (unit, whose convention).

    FASTSim: NREL, cycle files of versions 1 to 3. VECTO: user manual, driving cycles, where names may stand without
    angle brackets in a .vdri file. hevopt: its own cycle files.
    """
    known = {n: (_FASTSIM[n], "FASTSim convention") for n in names if n in _FASTSIM}
    if grade_ends_step("grade", names):
        known["grade"] = ("fraction", "FASTSim convention")
    elif "grade" in names and set(names) <= set(CYCLE_COLUMNS):
        known["grade"] = ("fraction", "hevopt convention")
    for name in names:
        bare = name.lower() if name.startswith("<") else f"<{name.lower()}>" * vecto
        if bare in _VECTO:
            known[name] = (_VECTO[bare], "VECTO convention")
    return known
