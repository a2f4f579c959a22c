"""A sketch of a car's driveline: where shafts, parts, engine, machines and battery are drawn.

Every shaft is an upright line; the wheels' stands on the right, and a shaft stands further left the more parts lie
between. A part lies in a row of its own between the lines of its shafts; what sits on a shaft alone, such as an
engine, ends a row on the left. So no two things share a place, whatever the driveline.
"""

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

from hevopt.car.parts import WHEEL
from hevopt.pages.comparison.saved_car import CarAbout, PartAbout

_COLUMN, _ROW, _MARGIN = 112, 62, 8
# Half of what a label may take to either side, and below the middle of its icon.
_HALF, _BELOW = 50, 40
_LETTERS_MAX = 17
_OVERHANG = 13
IconKind = Literal[
    "gear", "gearbox", "clutch", "one-way clutch", "planetary set", "shaft brake", "torque converter", "engine",
    "machine", "battery", "wheels",
]  # fmt: skip


class SketchLine(NamedTuple):
    """A line between two points. kind: a shaft, what joins it to a part, or a wire; name: of the shaft."""

    x1: float
    y1: float
    x2: float
    y2: float
    kind: Literal["shaft", "joint", "wire"]
    name: str = ""


class SketchIcon(NamedTuple):
    """A thing at its middle, name and note below. tall: how far it reaches down to a row of its own."""

    kind: IconKind
    x: float
    y: float
    name: str
    note: str
    tall: float = 0.0

    @property
    def label(self) -> str:
        """The name as there is room for it."""
        long = len(self.name) > _LETTERS_MAX
        return f"{self.name[: _LETTERS_MAX - 1]}…" if long else self.name


@dataclass(frozen=True, slots=True)
class Sketch:
    """Everything that is drawn. box: left, top, width, height; words: the same for who cannot see it."""

    box: tuple[float, float, float, float]
    lines: list[SketchLine]
    icons: list[SketchIcon]
    words: str


class _Item(NamedTuple):
    """What hangs on a shaft: a part with the shafts that it reaches and those known before; or what ends there."""

    kind: IconKind
    name: str
    note: str
    reached: tuple[str, ...] = ()
    known: tuple[str, ...] = ()


@dataclass(slots=True)
class _Rows:
    """Where things are placed: (shaft, row) touched, and (shaft, item, rows of what lies beyond it)."""

    items: Mapping[str, Sequence[_Item]]
    touched: list[tuple[str, int]] = field(default_factory=list)
    placed: list[tuple[str, _Item, list[int]]] = field(default_factory=list)

    def place(self, shaft: str, row: int) -> int:
        """Place a shaft with all that hangs on it from a row on; the next free row."""
        self.touched.append((shaft, row))
        start = row
        for item in self.items[shaft]:
            self.touched.append((shaft, row))
            rows = []
            for other in item.reached:
                rows.append(row)
                row = self.place(other, row)
            for other in item.known:
                rows.append(row)
                self.touched.append((other, row))
                row += 1
            row += not rows
            self.placed.append((shaft, item, rows or [row - 1]))
        return max(row, start + 1)


def sketch_of(about: CarAbout) -> Sketch:
    """The sketch of a car."""
    items, roots = _hung(about)
    layers = _layers(items, roots)
    rows, row = _Rows(items), 0
    for root in roots:
        row = rows.place(root, row)
    lines, icons = _drawn(rows, layers)
    _add_battery(about, lines, icons)
    left = min(icon.x for icon in icons) - _HALF - _MARGIN
    right = max(icon.x for icon in icons) + _HALF
    bottom = max(icon.y + icon.tall for icon in icons) + _BELOW + _MARGIN
    top = -2 * _OVERHANG
    return Sketch((left, top, right - left, bottom - top), lines, icons, _words(about))


def _hung(about: CarAbout) -> tuple[dict[str, list[_Item]], list[str]]:
    """Shaft -> what hangs on it, in the order of the search from the wheels; the shafts where that begins."""
    items: dict[str, list[_Item]] = {}
    roots, used = [], set()
    shafts = [WHEEL, *filter(None, [about.engine_shaft]), *(m.shaft for m in about.machines)]
    for root in (*shafts, *(shaft for part in about.parts for shaft in part.shafts)):
        if root in items:
            continue
        roots.append(root)
        items[root] = []
        waiting = deque([root])
        while waiting:
            shaft = waiting.popleft()
            for n, part in enumerate(about.parts):
                if n not in used and shaft in part.shafts:
                    used.add(n)
                    item = _part_item(part, shaft, items)
                    items[shaft].append(item)
                    items |= {other: [] for other in item.reached}
                    waiting.extend(item.reached)
    for machine in about.machines:
        power = "" if machine.power_w is None else f"{machine.power_w / 1e3:.3g} kW"
        items[machine.shaft].append(_Item("machine", machine.name, power))
    if about.engine_shaft is not None:
        engine = _Item("engine", "engine", f"{about.engine_w / 1e3:.3g} kW")
        items[about.engine_shaft].insert(0, engine)
        _engine_first(items, about.engine_shaft)
    return items, roots


def _part_item(part: PartAbout, shaft: str, found: Mapping[str, Sequence[_Item]]) -> _Item:
    others = [other for other in part.shafts if other != shaft]
    new = tuple(dict.fromkeys(other for other in others if other not in found))
    known = tuple(other for other in others if other in found)
    return _Item(part.kind, part.name, part.note, new, known)


def _engine_first(items: dict[str, list[_Item]], engine: str) -> None:
    """What leads to the engine first, so that its way to the wheels is the top row."""

    def leads(item: _Item) -> bool:
        return item.kind == "engine" or any(
            other == engine or any(map(leads, items[other])) for other in item.reached
        )

    for hung in items.values():
        hung.sort(key=lambda item: not leads(item))


def _layers(items: Mapping[str, Sequence[_Item]], roots: Sequence[str]) -> dict[str, int]:
    """Shaft -> most parts between it and the wheels; a part leads from a shaft to those found later."""
    layers = {root: int(root != WHEEL) for root in roots}
    for shaft, hung in items.items():
        for item in hung:
            for other in (*item.reached, *item.known):
                layers[other] = max(layers.get(other, 0), layers[shaft] + 1)
    return layers


def _drawn(rows: _Rows, layers: Mapping[str, int]) -> tuple[list[SketchLine], list[SketchIcon]]:
    x = {shaft: -_COLUMN * layer for shaft, layer in layers.items()}
    lines, icons = [], []
    for shaft in x:
        ys = [_ROW * row for name, row in rows.touched if name == shaft]
        top, end = min(ys) - _OVERHANG, max(ys) + _OVERHANG
        lines.append(SketchLine(x[shaft], top, x[shaft], end, "shaft", shaft))
        if shaft == WHEEL:
            middle = (min(ys) + max(ys)) / 2
            lines.append(SketchLine(0, middle, _COLUMN / 3, middle, "joint"))
            icons.append(SketchIcon("wheels", _COLUMN / 3, middle, "wheels", ""))
    for shaft, item, at in rows.placed:
        here, first, last = x[shaft] - _COLUMN / 2, _ROW * at[0], _ROW * at[-1]
        lines.append(SketchLine(x[shaft], first, here, first, "joint"))
        for other, row in zip((*item.reached, *item.known), at, strict=False):
            lines.append(SketchLine(here, _ROW * row, x[other], _ROW * row, "joint"))
        icons.append(SketchIcon(item.kind, here, first, item.name, item.note, last - first))
    return lines, icons


def _add_battery(about: CarAbout, lines: list[SketchLine], icons: list[SketchIcon]) -> None:
    """The battery left of all machines, and a wire to each."""
    machines = [icon for icon in icons if icon.kind == "machine"]
    if not machines:
        return
    first, last = min(icon.y for icon in machines), max(icon.y for icon in machines)
    x = min(icon.x for icon in machines) - 0.8 * _COLUMN
    while any(
        first <= icon.y <= last and abs(icon.x - x) < _COLUMN
        for icon in icons
        if icon.kind != "machine"
    ):
        x -= _COLUMN / 2  # fmt: skip
    lines += [SketchLine(x, icon.y, icon.x, icon.y, "wire") for icon in machines]
    if last > first:
        lines.append(SketchLine(x, first, x, last, "wire"))
    icons.append(SketchIcon("battery", x, last, "battery", f"{about.battery_j / 3.6e6:.3g} kWh"))


def _words(about: CarAbout) -> str:
    """The driveline in words, thing by thing."""
    said = [] if about.engine_shaft is None else [f"engine on {about.engine_shaft}"]
    said += [f"{machine.name} on {machine.shaft}" for machine in about.machines]
    for part in about.parts:
        joined = " and ".join((", ".join(part.shafts[:-1]), part.shafts[-1]))
        where = f"between {joined}" if len(part.shafts) > 1 else f"on {part.shafts[0]}"
        said.append(f"{part.name} {where}")
    return "; ".join(said)
