"""How fast cars are, for the terminal and as JSON."""

from collections.abc import Sequence
from typing import Any

from rich.table import Table
from rich.text import Text

from hevopt.forward.performance import DISTANCES_M, SPEEDS_KMH, SUSTAINED_KMH, Performance
from hevopt.output.tables import number, titled_table
from hevopt.units import KMH_PER_MPS

# What is to be known beside every figure of the first seconds.
NOTE = (
    "steady map: a turbocharged engine is slower in the first seconds than this says (--engine-model mean_value; "
    "--boost-lag)"
)
MEAN_VALUE_NOTE = (
    "mean value: begun settled, without load at launch speed and at constant speed in gear; top speed and slopes "
    "by the file's full load; hole filled: the machine adds what the engine lacks of its steady full load, no more"
)


def speed_table(found: Sequence[Performance]) -> Table:
    """Times from rest to speeds and distances, and what the machine took."""
    table = _table("from rest, s", *(f"{kmh}\nkm/h" for kmh in SPEEDS_KMH))
    for distance in DISTANCES_M:
        table.add_column(f"{distance:g} m\ns", justify="right")
        table.add_column("at\nkm/h", justify="right")
    table.add_column("battery\nkJ to 100", justify="right")
    table.add_column("repeats\nto empty", justify="right")
    for of in found:
        cells = [number(of.to_speed_s[kmh], 2) for kmh in SPEEDS_KMH]
        for distance in DISTANCES_M:
            there = of.to_distance[distance]
            cells += (
                ["-", "-"]
                if there is None
                else [f"{there[0]:.2f}", f"{there[1] * KMH_PER_MPS:.0f}"]
            )
        used = of.to_100_j if of.boosts or of.car.electric else None
        cells.append("-" if used is None else f"{used / 1e3:.0f}")
        cells.append(number(of.repeats, 1))
        table.add_row(Text(of.name), *cells)
    return table


def gear_table(found: Sequence[Performance]) -> Table:
    """Times in gear."""
    cases = list(dict.fromkeys(case for of in found for case in of.in_gear_s))
    table = _table("in gear, s", *(f"{gear}.\n{low}-{high}" for gear, low, high in cases))
    for of in found:
        table.add_row(Text(of.name), *(number(of.in_gear_s.get(case), 2) for case in cases))
    return table


def help_table(found: Sequence[Performance]) -> Table:
    """What the machine takes from the battery in gear, of those whose machine helps."""
    helped = [of for of in found if of.boosts]
    cases = list(dict.fromkeys(case for of in helped for case in of.in_gear_j))
    heads = (f"{gear}.\n{low}-{high}" for gear, low, high in cases)
    table = _table("in gear, kJ from the battery", *heads)
    for of in helped:
        cells = (of.in_gear_j.get(case) for case in cases)
        table.add_row(Text(of.name), *(number(None if j is None else j / 1e3, 1) for j in cells))
    return table


def limit_table(found: Sequence[Performance]) -> Table:
    """Top speeds of the engine alone, and slopes."""
    gears = max(len(of.top_mps) for of in found)
    heads = [f"top {gear}.\nkm/h" for gear in range(1, gears + 1)]
    heads += ["start\n%", *(f"{kmh} km/h\n%" for kmh in SUSTAINED_KMH)]
    table = _table("top speed and slope", *heads)
    for of in found:
        tops = [number(_kmh(of.top_mps.get(gear)), 0) for gear in range(1, gears + 1)]
        slopes = [of.start_slope, *(of.slope[kmh] for kmh in SUSTAINED_KMH)]
        table.add_row(Text(of.name), *tops, *(f"{100 * slope:.1f}" for slope in slopes))
    return table


def as_dict(of: Performance) -> dict[str, Any]:
    """All figures, for JSON."""
    return {
        "car": of.car.name,
        "e_boost": of.boosts,
        "hole_filled": of.fills,
        "engine_model": of.engine_model,
        "mass_kg": of.car.vehicle.mass_kg,
        "to_speed_s": {str(kmh): time for kmh, time in of.to_speed_s.items()},
        "to_distance": {
            f"{distance:g}": None if there is None else {"time_s": there[0], "speed_mps": there[1]}
            for distance, there in of.to_distance.items()
        },
        "in_gear": [
            {
                "gear": gear,
                "from_kmh": low,
                "to_kmh": high,
                "time_s": time,
                "battery_j": of.in_gear_j[gear, low, high],
            }
            for (gear, low, high), time in of.in_gear_s.items()
        ],
        "top_mps": {str(gear): top for gear, top in of.top_mps.items()},
        "start_slope": of.start_slope,
        "slope": {str(kmh): slope for kmh, slope in of.slope.items()},
        "battery_to_100_j": of.to_100_j,
        "repeats_until_empty": of.repeats,
    }


def _kmh(speed_mps: float | None) -> float | None:
    return None if speed_mps is None else speed_mps * KMH_PER_MPS


def _table(title: str, *heads: str) -> Table:
    table = titled_table(title)
    table.add_column("car", no_wrap=True)
    for head in heads:
        table.add_column(head, justify="right")
    return table
