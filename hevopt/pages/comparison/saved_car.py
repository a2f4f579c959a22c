"""What a saved comparison holds of a car: what it is, its maps, and what its rows share."""

from typing import Annotated, Literal

from pydantic import Field

from hevopt.files.toml import FileModel

# Far beyond any figure, and far from where sums and squares of floats end.
_NUMBER_MAX = 1e100
Number = Annotated[float, Field(ge=-_NUMBER_MAX, le=_NUMBER_MAX)]
Whole = Annotated[int, Field(ge=-(2**53), le=2**53)]
# More would be no driveline that a sketch could show.
_PARTS_MAX = 100
PartKind = Literal[
    "gear",
    "gearbox",
    "clutch",
    "one-way clutch",
    "planetary set",
    "shaft brake",
    "torque converter",
]
GearSource = Literal["cycle", "shift speeds", "plan", "none"]


class MapFigures(FileModel):
    """A component over (speed, torque); None where it cannot be used or the figure has no meaning.

    efficiency: of the engine, or of the machine in the direction of its power
    nox_kgpj: NOx per work, of engines only; limit_nm: largest torque over speed; least_nm: lowest,
    None beyond a measured engine map's speeds
    """

    name: str
    speed_radps: list[Number]
    torque_nm: list[Number]
    efficiency: list[list[Number | None]]
    nox_kgpj: list[list[Number | None]] | None
    limit_nm: list[Number]
    least_nm: list[Number | None]


class PartAbout(FileModel):
    """A part of a driveline, the shafts that it joins, and what there is to know of it, in a word or two."""

    kind: PartKind
    name: str
    shafts: list[str] = Field(min_length=1, max_length=3)
    note: str


class MachineAbout(FileModel):
    """A machine of a driveline: its own name, its component's, its shaft; power None where nothing limits it."""

    name: str
    component: str
    shaft: str
    power_w: Number | None


class CarAbout(FileModel):
    """What a car is.

    engine_shaft: None without an engine; parts: of the driveline, the road's shaft being "wheel"
    battery_j, window_j: stored between the ends of the battery's curves, and of the window
    battery_soc, battery_v: open-circuit voltage, linear between points; capacity_as: what makes them energy
    gears: where the gears of a step come from; shift_gap_s: time without torque at a change, None without a gearbox
    braking_mps, braking_share: share of the braking that the machine may take over speed; empty where all it can
    """

    description: str
    mass_kg: Number
    engine: str
    engine_w: Number
    engine_shaft: str | None
    start_fuel_kg: Number
    machines: list[MachineAbout]
    parts: list[PartAbout] = Field(max_length=_PARTS_MAX)
    battery_j: Number
    window_j: Number
    battery_soc: list[Number]
    battery_v: list[Number]
    capacity_as: Number
    functions: list[str]
    gears: GearSource
    shift_gap_s: Number | None
    braking_mps: list[Number]
    braking_share: list[Number]


class CarFigures(FileModel):
    """What the rows of one architecture share; lists are (time,).

    price_kgpj: what a joule of end charge is worth, from the certificate; certified_gap_percent: how far dynamic
    programming's rollout lies above the bound, the certificate's own looseness at most
    about: what the car is; None in older files
    """

    name: str
    time_s: list[Number]
    step_s: list[Number]
    speed_mps: list[Number]
    wheel_power_w: list[Number]
    missing_torque_nm: list[Number]
    soc_min: Number
    soc_max: Number
    heating_value_jpkg: Number
    price_kgpj: Number
    certified_gap_percent: Number | None
    engine: MapFigures
    machine: MapFigures
    about: CarAbout | None = None
