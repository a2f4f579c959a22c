"""The saved form of a comparison: JSON, compressed with gzip, from which its page can be made again.

Rows hold every figure at full precision; traces and maps are rounded, see `collect.py`.
"""

import gzip
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, InstanceOf, PlainSerializer

from hevopt.bounds.claim import Claim
from hevopt.files.lookup import dumped_json
from hevopt.files.toml import FileModel
from hevopt.pages.comparison.saved_car import CarFigures, Number, Whole
from hevopt.studies.status import Status

FORMAT = "hevopt comparison 2"
# Text in JSON.
SavedStatus = Annotated[InstanceOf[Status], BeforeValidator(Status.read), PlainSerializer(str)]
SavedClaim = Annotated[InstanceOf[Claim], BeforeValidator(Claim.read), PlainSerializer(str)]


class RowFigures(FileModel):
    """The figures of `rows.Row`."""

    architecture: str
    strategy: str
    status: SavedStatus
    fuel_l_per_100km: Number | None
    delta_fuel_percent: Number | None
    co2_g_per_km: Number | None
    nox_mg_per_km: Number | None
    delta_nox_percent: Number | None
    soc_start: Number | None
    soc_end: Number | None
    delta_energy_percent: Number | None
    electricity_kwh_per_100km: Number | None = None
    fuel_corrected_l_per_100km: Number | None
    engine_starts: Whole | None
    bound_l_per_100km: Number | None
    gap_percent: Number | None
    certificate: SavedClaim | None
    solve_s: Number | None

    @property
    def electric(self) -> bool:
        """Whether it is a solved row of a car without an engine, as `rows.Row.electric`."""
        return self.fuel_l_per_100km is not None and self.fuel_corrected_l_per_100km is None


class SavedTrace(FileModel):
    """What a row does, (time,), but soc: (time + 1,). operation: index into the names of `operations`."""

    soc: list[Number]
    operation: list[Whole]
    engine_gear: list[Whole]
    machine_gear: list[Whole]
    fuel_kg: list[Number]
    nox_kg: list[Number]
    battery_power_w: list[Number]
    engine_torque_nm: list[Number]
    engine_speed_radps: list[Number]
    machine_torque_nm: list[Number]
    machine_speed_radps: list[Number]


class Link(FileModel):
    """Energy that goes from one place to another over the whole cycle."""

    source: str
    target: str
    energy_j: Number


class Item(FileModel):
    """One entry of the energy balance."""

    name: str
    energy_j: Number


class Energy(FileModel):
    """Where the energy of a cycle comes from and where it stays: sum(taken) = sum(spent) + residual_j.

    links: the same, and what flows in between; of_which: shares of entries, for reading, in no sum
    """

    links: list[Link]
    taken: list[Item]
    spent: list[Item]
    residual_j: Number
    of_which: list[Item]


class Share(FileModel):
    """What one mode of operation takes of a cycle; NOx None where the engine has no data on it."""

    operation: str
    time_s: Number
    distance_m: Number
    fuel_kg: Number
    nox_kg: Number | None


class SavedMember(FileModel):
    """One member of a rule family: thresholds, and what comes of them; NOx None where it is not known.

    threshold_mps: None where every speed is driven electrically, and like threshold_soc in older files

    neutral: keeps the SOC window, and its end charge is that asked within 1 % of the fuel's energy, as of rows
    """

    threshold_w: Number
    threshold_mps: Number | None = None
    threshold_soc: Number | None = None
    nox_cap_kgps: Number | None = None
    corrected_l_per_100km: Number
    nox_mg_per_km: Number | None
    surplus_j: Number
    neutral: bool
    chosen: bool


class Detail(FileModel):
    """All of a row beyond its figures. limits: name of a limit -> steps within 1 % of it.

    engine_on_s, engine_off_s: lengths of the spells; equivalence_kgpj: the strategy's own price, if it has one
    solver: what a solver reports as trouble
    """

    trace: SavedTrace
    energy: Energy
    shares: list[Share]
    limits: dict[str, Whole]
    engine_on_s: list[Number]
    engine_off_s: list[Number]
    equivalence_kgpj: Number | None
    calibration: list[SavedMember]
    solver: list[str]


class SavedRow(FileModel):
    """A row with its detail; None where the case failed."""

    figures: RowFigures
    detail: Detail | None


class PublishedFigure(FileModel):
    """One published statement, ours beside it, and what differs."""

    what: str
    published: str
    ours: str
    differs: str


class ParetoPoint(FileModel):
    """A plan on the front, with the weights on NOx for which none found is better; see `figures_of`."""

    nox_weight: Number
    nox_weights: list[Number]
    strategy: str
    fuel_l_per_100km: Number
    nox_mg_per_km: Number
    bound_l_per_100km: Number
    gap_percent: Number | None
    certificate: str


class Corner(FileModel):
    """A corner of the outer front."""

    nox_mg_per_km: Number
    fuel_l_per_100km: Number


class ParetoFront(FileModel):
    """The front of one architecture: plans from least fuel to least NOx, and the proven outer front."""

    architecture: str
    cycle: str
    points: list[ParetoPoint]
    outer: list[Corner]
    gap_percent: Number


class Sensitivity(FileModel):
    """How a result moves with one parameter; see `sensitivity.Effect`. reasons: none in older files."""

    architecture: str
    strategy: str
    parameter: str
    unit: str
    values: list[Number]
    fuel_l_per_100km: list[Number | None]
    delta_percent: list[Number | None]
    nox_mg_per_km: list[Number | None]
    delta_nox_percent: list[Number | None]
    elasticity: Number | None
    elasticity_nox: Number | None
    reasons: list[str | None] | None = None


class Results(FileModel):
    """A comparison as it is saved.

    changes: what of the cars' files was changed, line by line
    end_asked: car -> state of charge asked at the end, where it is another than the start's
    inputs: file -> SHA-256; versions: name -> version; failures: architecture, or it and strategy -> message
    lost_proofs: architecture and kind of proof -> why it was tried and not found
    peeking: car and strategy -> what shows that a strategy from outside knows more of the cycle than it says
    nox_limit_mg_per_km: a limit to hold rows against, where one was given
    """

    format: Literal["hevopt comparison 2"] = FORMAT
    cycle: str
    distance_m: Number
    reference: str | None
    nox_weight: Number
    free_gear: bool
    end_asked: dict[str, Number]
    command: str
    changes: list[str]
    inputs: dict[str, str]
    versions: dict[str, str]
    operations: list[str]
    causal: list[str]
    cars: dict[str, CarFigures]
    rows: list[SavedRow]
    failures: dict[str, str]
    lost_proofs: dict[str, str] = Field(default_factory=dict)
    peeking: dict[str, str] = Field(default_factory=dict)
    published: list[PublishedFigure]
    pareto: list[ParetoFront] | None = None
    sensitivity: list[Sensitivity] | None = None
    nox_limit_mg_per_km: Number | None = None

    def text(self) -> bytes:
        """As JSON."""
        return dumped_json(self.model_dump()).encode()

    def packed(self) -> bytes:
        """The contents of the file; the same results give the same bytes."""
        return packed(self.text())


def packed(text: bytes) -> bytes:
    """The contents of a file with results as JSON."""
    return gzip.compress(text, compresslevel=6, mtime=0)
