"""What architecture and component files may hold: pydantic models, one per kind of file or table.

Keys carry their unit as a suffix; bounds are wide where physics sets none, and keep arithmetic from overflowing.
"""

from math import pi
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, Discriminator, Field, Tag, model_validator

from hevopt.datafile import SHAPES, FileModel, shape_of

Function = Literal["start_stop", "e_boost", "regenerative_braking", "nox_cut", "power_management"]
CouplingKind = Literal[
    "none", "belt", "crankshaft", "gearbox_input", "gearbox_output", "even_shaft"
]


def _on_one_line(text: str) -> str:
    if not text.isprintable() or text.isspace():
        raise ValueError("printable characters on one line are needed")
    return text


Number, List, Table, Named = map(Tag, SHAPES)
Shape = Discriminator(shape_of)
Name = Annotated[str, Field(min_length=1, max_length=80), AfterValidator(_on_one_line)]
Description = Annotated[str, Field(max_length=500), AfterValidator(_on_one_line)]
# Wide bounds: their task is that no sum or square of what a file holds overflows.
Fraction = Annotated[float, Field(ge=0.01, le=1)]
Soc = Annotated[float, Field(ge=0, le=1)]
Positive = Annotated[float, Field(ge=1e-6, le=1e9)]
NotNegative = Annotated[float, Field(ge=0, le=1e9)]
Coefficient = Annotated[float, Field(ge=-1e6, le=1e6)]
NotPositive = Annotated[float, Field(ge=-1e6, le=0)]
Ratio = Annotated[float, Field(ge=0.01, le=50)]
Curve = Annotated[list[Coefficient], Field(min_length=2, max_length=10_000)]
Speeds = Annotated[
    list[Annotated[float, Field(ge=0, le=1e6)]], Field(min_length=2, max_length=10_000)
]
Mass = Annotated[float, Field(ge=50, le=100_000)]
AuxiliaryPower = Annotated[float, Field(ge=0, le=50_000)]
StartFuel = Annotated[float, Field(ge=0, le=100)]
ShiftFuel = Annotated[float, Field(ge=0, le=10)]
ScaleFactor = Annotated[float, Field(ge=0.05, le=20)]
Ohm = Annotated[Annotated[NotNegative, Number] | Annotated[list[NotNegative], List], Shape]
_MAP_MAX = 1e6
# exp() of more than this overflows.
_EXPONENT_MAX = 700.0


def _names_a_file(table: dict[str, Any]) -> dict[str, Any]:
    if not isinstance(table.get("file"), str):
        raise ValueError('a table needs file = "name"; its other keys replace those of that file')
    return table


# A component: the name or path of its file, or a table {file, ...} whose other keys replace the file's.
Component = Annotated[
    Annotated[str, Named] | Annotated[dict[str, Any], AfterValidator(_names_a_file), Table],
    Discriminator(lambda value: "a table" if isinstance(value, dict) else "a name"),
]


class CouplingFile(FileModel):
    """How the machine joins the shafts."""

    kind: CouplingKind
    second_clutch: bool | None = None
    machine_ratio: Ratio | None = None
    machine_efficiency: Fraction | None = None
    disconnects_above_speed_max: bool = False
    machine_shift_fuel_g: Annotated[float, Field(ge=0, le=10)] = 0.0

    @model_validator(mode="after")
    def _keys_of_kind(self):
        needed = {
            "gearbox_input": {"second_clutch"},
            "gearbox_output": {"machine_ratio", "machine_efficiency"},
        }.get(self.kind, set())
        allowed = {
            "gearbox_output": needed | {"disconnects_above_speed_max"},
            "even_shaft": {"machine_shift_fuel_g"},
        }.get(self.kind, needed)
        given = self.model_fields_set - {"kind"}
        if missing := needed - given:
            raise ValueError(f"kind {self.kind!r} needs {', '.join(sorted(missing))}")
        if extra := given - allowed:
            raise ValueError(f"kind {self.kind!r} does not use {', '.join(sorted(extra))}")
        return self


class ArchitectureFile(FileModel):
    """An architecture: its components, functions (Table 1) and coupling."""

    name: Name
    description: Description = ""
    car: Component
    engine: Component
    gearbox: Component
    machine: Component
    battery: Component
    hybrid_mass_kg: Annotated[float, Field(ge=-500, le=5000)] = 0.0
    functions: list[Function]
    gear: Literal["cycle", "free"] = "cycle"
    coupling: CouplingFile


class RoadLoadFile(FileModel):
    """Rolling and air resistance, equations (5) to (10), or coast-down coefficients (12)."""

    rolling_c0: Annotated[float, Field(ge=0, le=0.2)] | None = None
    rolling_c1_spm: Coefficient = 0.0
    rolling_c2_s2pm2: Coefficient = 0.0
    rolling_c3_s3pm3: Coefficient = 0.0
    drag_area_m2: Annotated[float, Field(ge=0, le=20)] | None = None
    air_density_kgpm3: Annotated[float, Field(ge=0.01, le=2)] = 1.2
    coastdown_c0_n: Annotated[float, Field(ge=0, le=1e6)] | None = None
    coastdown_c1_nspm: Coefficient = 0.0
    coastdown_c2_ns2pm2: Coefficient = 0.0

    @model_validator(mode="after")
    def _one_form(self):
        coastdown = {key for key in self.model_fields_set if key.startswith("coastdown")}
        parts = self.model_fields_set - coastdown
        whole = {"rolling_c0", "drag_area_m2"} <= parts or "coastdown_c0_n" in coastdown
        if not whole or (coastdown and parts):
            raise ValueError(
                "give either rolling_c0 and drag_area_m2, or coastdown_c0_n, and no key of the other "
                f"form; found: {', '.join(sorted(self.model_fields_set)) or 'none'}"
            )
        return self


class CarFile(FileModel):
    """A car without powertrain."""

    name: Name
    mass_kg: Mass
    tyre_radius_m: Annotated[float, Field(ge=0.1, le=1.5)]
    wheel_inertia_kgm2: Annotated[float, Field(ge=0, le=1000)]
    auxiliary_power_w: AuxiliaryPower
    road_load: RoadLoadFile


class FuelFile(FileModel):
    heating_value_mjpkg: Annotated[float, Field(ge=5, le=150)]
    density_kgpl: Annotated[float, Field(ge=0.05, le=2)]
    co2_kgpkg: Annotated[float, Field(ge=0, le=5)]


class FullLoadFile(FileModel):
    speed_rpm: Speeds
    torque_nm: Curve

    @model_validator(mode="after")
    def _curve(self):
        if len(self.speed_rpm) != len(self.torque_nm):
            raise ValueError("speed_rpm and torque_nm must have one length")
        if (np.diff(self.speed_rpm) <= 0).any():
            raise ValueError("speed_rpm must increase")
        if min(self.torque_nm) <= 0:
            raise ValueError(f"every torque_nm must be > 0, found {min(self.torque_nm):g}")
        return self


class FuelCoefficientsFile(FileModel):
    a: Annotated[float, Field(ge=0.01, le=10)]
    b: Coefficient
    c: Coefficient
    a2: NotPositive
    l: Annotated[float, Field(ge=-1e6, le=-1e-3)]  # noqa: E741
    l2: NotPositive


class NoxCoefficientsFile(FileModel):
    m0: NotNegative
    lo: NotNegative
    hi: NotNegative
    p0: Coefficient
    p1: Coefficient
    dp: Annotated[float, Field(ge=0.01, le=1e6)]


def _check_grid(name: str, grid: list[list[float]], rows: int, columns: int) -> None:
    if len(grid) != rows or any(len(row) != columns for row in grid):
        raise ValueError(f"{name} must have {rows} rows of {columns} values")
    values = np.array(grid)
    if np.isnan(values).all():
        raise ValueError(f"{name} holds nan only; give the measured values")
    if not (np.isnan(values) | ((values >= 0) & (values <= _MAP_MAX))).all():
        raise ValueError(f"{name}: allowed: 0 to {_MAP_MAX:g}, or nan where not measured")


class EngineGridFile(FileModel):
    """A measured map: rows are speeds, columns torques; nan marks a cell that was not measured."""

    speed_rpm: Speeds
    torque_nm: Curve
    fuel_gps: list[list[Annotated[float, Field(allow_inf_nan=True)]]]
    nox_gps: list[list[Annotated[float, Field(allow_inf_nan=True)]]] | None = None
    motoring_torque_nm: Curve

    @model_validator(mode="after")
    def _shapes(self):
        shape = (len(self.speed_rpm), len(self.torque_nm))
        for name in ("fuel_gps", "nox_gps"):
            grid = getattr(self, name)
            if grid is not None:
                _check_grid(name, grid, *shape)
        if len(self.motoring_torque_nm) != shape[0] or max(self.motoring_torque_nm) >= 0:
            raise ValueError(f"motoring_torque_nm must be {shape[0]} values below 0")
        if (np.diff(self.speed_rpm) <= 0).any() or (np.diff(self.torque_nm) <= 0).any():
            raise ValueError("speed_rpm and torque_nm must increase")
        return self


class ScaleFile(FileModel):
    """Another size of the same design: one factor, called by any of its names; the law is in scaling.py."""

    torque: ScaleFactor | None = None
    power: ScaleFactor | None = None

    @model_validator(mode="after")
    def _one_name(self):
        given = sorted(self.model_fields_set)
        if len(given) != 1:
            names = ", ".join(type(self).model_fields)
            raise ValueError(
                f"give exactly one of {names}: speeds stay, so that they are one factor; "
                f"found: {', '.join(given) or 'none'}"
            )
        return self

    @property
    def factor(self) -> float:
        """The factor given."""
        return next(value for value in self.model_dump().values() if value is not None)


class EngineScaleFile(ScaleFile):
    displacement: ScaleFactor | None = None


class EngineFile(FileModel):
    name: Name
    displacement_cm3: Annotated[float, Field(ge=10, le=100_000)]
    bore_mm: Annotated[float, Field(ge=10, le=1000)]
    stroke_mm: Annotated[float, Field(ge=10, le=1000)]
    idle_rpm: Annotated[float, Field(ge=50, le=5000)]
    inertia_kgm2: Annotated[float, Field(ge=0, le=100)]
    start_fuel_g: StartFuel
    fuel: FuelFile
    full_load: FullLoadFile
    fuel_coefficients: FuelCoefficientsFile | None = None
    fuel_map: EngineGridFile | None = None
    nox_coefficients: NoxCoefficientsFile | None = None
    scale: EngineScaleFile | None = None

    @model_validator(mode="after")
    def _one_map(self):
        if (self.fuel_coefficients is None) == (self.fuel_map is None):
            raise ValueError("give either fuel_coefficients or fuel_map")
        if self.fuel_map is not None and self.nox_coefficients is not None:
            raise ValueError("with fuel_map, NOx is nox_gps in the map, not nox_coefficients")
        low, high = self.full_load.speed_rpm[0], self.full_load.speed_rpm[-1]
        if not low <= self.idle_rpm < high:
            raise ValueError(
                f"idle_rpm {self.idle_rpm:g} must lie within full_load.speed_rpm, {low:g} to {high:g}"
            )
        return self

    @model_validator(mode="after")
    def _fuel_at_every_speed(self):
        """The p_mf equation (engine.py) has a root, and rising fuel, up to full load and top speed."""
        if self.fuel_coefficients is None:
            return self
        k, curve = self.fuel_coefficients, self.full_load
        rpm = np.union1d(np.linspace(0.0, curve.speed_rpm[-1], 201), curve.speed_rpm)
        piston_mps = 2 * self.stroke_mm / 1e3 * rpm / 60
        slope = k.a + k.b * piston_mps + k.c * piston_mps**2
        torque = np.interp(rpm, curve.speed_rpm, curve.torque_nm)
        full_bar = 4 * pi * torque / (self.displacement_cm3 * 1e-6) / 1e5
        root = slope**2 + 4 * k.a2 * (full_bar - k.l - k.l2 * piston_mps**2)
        if (slope <= 0).any():
            raise ValueError(
                f"fuel_coefficients: a + b cm + c cm² is {slope.min():.3g} at "
                f"{rpm[np.argmin(slope)]:g} rpm; it must be > 0 from 0 to full_load's top speed"
            )
        if (root < 0).any():
            raise ValueError(
                f"fuel_coefficients: full load at {rpm[np.argmin(root)]:g} rpm has no fuel; lower "
                "full_load.torque_nm or bring a2 closer to 0"
            )
        return self

    @model_validator(mode="after")
    def _nox_steepness(self):
        k = self.nox_coefficients
        if k is not None:
            tops = [k.p0 + k.p1 * (rpm / 1000 - 2) for rpm in (0.0, self.full_load.speed_rpm[-1])]
            if max(tops) > _EXPONENT_MAX * k.dp:
                raise ValueError(
                    f"nox_coefficients: (p0 + p1 (n/1000 - 2)) / dp reaches {max(tops) / k.dp:.3g} "
                    f"by full_load's top speed; allowed: up to {_EXPONENT_MAX:g}; raise dp"
                )
        return self


class ShiftSpeedsFile(FileModel):
    up_kmh: list[Positive]
    down_kmh: list[Positive]
    engage_before_launch_s: Annotated[float, Field(ge=0, le=60)] = 1.0


class FreeGearFile(FileModel):
    """What limits a gear that the strategy chooses."""

    shift_fuel_g: ShiftFuel
    engine_speed_min_rpm: Annotated[float, Field(ge=0, le=10_000)]


class GearboxFile(FileModel):
    name: Name
    ratios: Annotated[list[Ratio], Field(min_length=1, max_length=20)]
    final_drive_ratio: Ratio
    efficiency: Annotated[Annotated[Fraction, Number] | Annotated[list[Fraction], List], Shape]
    shift_speeds: ShiftSpeedsFile
    free_gear: FreeGearFile | None = None

    @model_validator(mode="after")
    def _lengths(self):
        gears, shifts = len(self.ratios), self.shift_speeds
        if isinstance(self.efficiency, list) and len(self.efficiency) != gears:
            raise ValueError(f"efficiency needs one value or {gears}, one per gear")
        if len(shifts.up_kmh) != gears - 1 or len(shifts.down_kmh) != gears - 1:
            raise ValueError(f"shift_speeds need {gears - 1} values each for {gears} gears")
        return self

    @model_validator(mode="after")
    def _falling(self):
        if list(self.ratios) != sorted(self.ratios, reverse=True):
            raise ValueError("ratios must fall from first gear to last")
        return self

    @model_validator(mode="after")
    def _no_hunting(self):
        shifts = self.shift_speeds
        if any(d >= u for u, d in zip(shifts.up_kmh, shifts.down_kmh, strict=False)):
            raise ValueError("each down_kmh must be below its up_kmh")
        if sorted(shifts.up_kmh) != shifts.up_kmh or sorted(shifts.down_kmh) != shifts.down_kmh:
            raise ValueError("shift speeds must rise from gear to gear")
        return self


class LossMapFile(FileModel):
    """A measured map: rows are speeds, columns torques; nan marks a cell that was not measured.

    symmetric: torque_nm holds values from 0 up, and the loss is the same at the opposite torque.
    """

    speed_rpm: Speeds
    torque_nm: Curve
    loss_w: list[list[Annotated[float, Field(allow_inf_nan=True)]]]
    symmetric: bool = False

    @model_validator(mode="after")
    def _shapes(self):
        _check_grid("loss_w", self.loss_w, len(self.speed_rpm), len(self.torque_nm))
        if (np.diff(self.speed_rpm) <= 0).any() or (np.diff(self.torque_nm) <= 0).any():
            raise ValueError("speed_rpm and torque_nm must increase")
        if self.symmetric and self.torque_nm[0] < 0:
            raise ValueError(
                f"symmetric needs torque_nm from 0 up, found {self.torque_nm[0]:g}; with torques of "
                "both signs leave symmetric out"
            )
        return self


class MachineFile(FileModel):
    name: Name
    kind: Literal["loss", "efficiency", "map"]
    power_max_w: Positive
    torque_max_nm: Positive | None = None
    speed_max_rpm: Positive | None = None
    inertia_kgm2: Annotated[float, Field(ge=0, le=100)] = 0.0
    efficiency: Fraction | None = None
    loss_c0_w: NotNegative | None = None
    loss_c1_ws: NotNegative | None = None
    loss_c2_ws2: NotNegative | None = None
    loss_c3_wpnm2: NotNegative | None = None
    loss_map: LossMapFile | None = None
    scale: ScaleFile | None = None

    @model_validator(mode="after")
    def _keys_of_kind(self):
        losses = [self.loss_c0_w, self.loss_c1_ws, self.loss_c2_ws2, self.loss_c3_wpnm2]
        if self.kind == "loss" and (None in losses or self.efficiency is not None):
            raise ValueError(
                "kind 'loss' needs loss_c0_w, loss_c1_ws, loss_c2_ws2, loss_c3_wpnm2 and no efficiency"
            )
        if self.kind == "efficiency" and (self.efficiency is None or any(losses)):
            raise ValueError("kind 'efficiency' needs efficiency and no loss_c*")
        if self.kind == "map" and (
            any(v is not None for v in losses) or self.efficiency is not None
        ):
            raise ValueError("kind 'map' needs the table [loss_map], and no efficiency or loss_c*")
        if (self.kind == "map") != (self.loss_map is not None):
            raise ValueError("the table [loss_map] goes with kind 'map'")
        return self


class LinearVoltageFile(FileModel):
    intercept: Positive
    slope: NotNegative


class SocFile(FileModel):
    """Window and start of the state of charge; `end` is the least at the end, by default the start."""

    start: Soc
    min: Soc
    max: Soc
    end: Soc | None = None

    @model_validator(mode="after")
    def _window(self):
        if not self.min < self.max:
            raise ValueError(f"empty window: min {self.min:g} must be below max {self.max:g}")
        if not self.min <= self.start <= self.max:
            raise ValueError(f"start {self.start:g} must lie in [{self.min:g}, {self.max:g}]")
        if self.end is not None and not self.min <= self.end <= self.max:
            raise ValueError(f"end {self.end:g} must lie in [{self.min:g}, {self.max:g}]")
        return self


class BatteryFile(FileModel):
    """A battery of equal cells in series, figures per cell, over SOC where they are lists."""

    name: Name
    cells_in_series: Annotated[int, Field(ge=1, le=10_000)]
    capacity_ah: Positive
    open_circuit_v: Annotated[
        Annotated[LinearVoltageFile, Table] | Annotated[list[Positive], List], Shape
    ]
    resistance_ohm: Ohm | None = None
    discharge_ohm: Ohm | None = None
    charge_ohm: Ohm | None = None
    curve_soc: list[Soc] | None = None
    coulombic_efficiency: Fraction = 1.0
    power_max_w: Positive | None = None
    current_max_a: Positive | None = None
    soc: SocFile

    @model_validator(mode="after")
    def _curves(self):
        given = self.model_fields_set & {"resistance_ohm", "discharge_ohm", "charge_ohm"}
        if given not in ({"resistance_ohm"}, {"discharge_ohm", "charge_ohm"}):
            raise ValueError(
                "give either resistance_ohm, or discharge_ohm and charge_ohm; found: "
                f"{', '.join(sorted(given)) or 'none'}"
            )
        lists = [v for v in (self.open_circuit_v, *self.resistances()) if isinstance(v, list)]
        if lists and self.curve_soc is None:
            raise ValueError("values over SOC need curve_soc")
        if any(len(v) != len(self.curve_soc) for v in lists):
            raise ValueError(f"values over SOC need {len(self.curve_soc)} entries, as curve_soc")
        if self.curve_soc is not None and (
            len(self.curve_soc) < 2 or (np.diff(self.curve_soc) <= 0).any()
        ):
            raise ValueError("curve_soc must increase and have at least 2 entries")
        return self

    def resistances(self) -> tuple:
        """Discharge and charge resistance as given."""
        if self.resistance_ohm is not None:
            return self.resistance_ohm, self.resistance_ohm
        return self.discharge_ohm, self.charge_ohm
