"""What a car's file may hold: mass, wheels, auxiliaries and road load."""

from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import ConfigDict, Field, model_validator

from hevopt.car_files.fields import AuxiliaryPower, Coefficient, Mass, Name
from hevopt.files.toml import FileModel

_FORMS = ({"rolling_c0", "drag_area_m2"}, {"coastdown_c0_n"})


def _one_form(schema: dict[str, Any]) -> None:
    """What a schema says of the two forms: the keys of one, and none of the other."""
    coastdown = [key for key in schema["properties"] if key.startswith("coastdown")]
    parts = [key for key in schema["properties"] if key not in coastdown]
    schema["oneOf"] = [
        {"required": sorted(needed), "properties": dict.fromkeys(others, False)}
        for needed, others in zip(_FORMS, (coastdown, parts), strict=True)
    ]


class RoadLoadFile(FileModel):
    """Rolling and air resistance, equations (5) to (10), or coast-down coefficients (12) with their mass."""

    model_config = ConfigDict(json_schema_extra=_one_form)

    rolling_c0: Annotated[float, Field(ge=0, le=0.2)] | None = None
    rolling_c1_spm: Coefficient = 0.0
    rolling_c2_s2pm2: Coefficient = 0.0
    rolling_c3_s3pm3: Coefficient = 0.0
    drag_area_m2: Annotated[float, Field(ge=0, le=20)] | None = None
    air_density_kgpm3: Annotated[float, Field(ge=0.01, le=2)] = 1.2
    coastdown_c0_n: Annotated[float, Field(ge=0, le=1e6)] | None = None
    coastdown_c1_nspm: Coefficient = 0.0
    coastdown_c2_ns2pm2: Coefficient = 0.0
    coastdown_mass_kg: Mass | None = None

    @model_validator(mode="after")
    def _one_form(self) -> Self:
        coastdown = {key for key in self.model_fields_set if key.startswith("coastdown")}
        parts = self.model_fields_set - coastdown
        whole = _FORMS[0] <= parts or _FORMS[1] <= coastdown
        if not whole or (coastdown and parts):
            raise ValueError(
                "give either rolling_c0 and drag_area_m2, or coastdown_c0_n, and no key of the other "
                f"form; found: {', '.join(sorted(self.model_fields_set)) or 'none'}"
            )
        return self


class BrakingFile(FileModel):
    """How much of the braking a machine may take: a share over speed, and what keeps the car stable."""

    speed_kmh: Annotated[
        list[Annotated[float, Field(ge=0, le=1000)]], Field(min_length=2, max_length=1000)
    ]
    machine_share: Annotated[
        list[Annotated[float, Field(ge=0, le=1)]], Field(min_length=2, max_length=1000)
    ]
    axle: Literal["front", "rear"] = "front"
    load_share: Annotated[float, Field(ge=0.05, le=0.95)]
    height_share: Annotated[float, Field(ge=0, le=1)]

    @model_validator(mode="after")
    def _curve(self) -> Self:
        if len(self.speed_kmh) != len(self.machine_share):
            raise ValueError("speed_kmh and machine_share must have one length")
        if (np.diff(self.speed_kmh) <= 0).any():
            raise ValueError("speed_kmh must increase")
        return self


class CarFile(FileModel):
    """A car without powertrain."""

    name: Name
    mass_kg: Mass
    tyre_radius_m: Annotated[float, Field(ge=0.1, le=1.5)]
    wheel_inertia_kgm2: Annotated[float, Field(ge=0, le=1000)]
    auxiliary_power_w: AuxiliaryPower
    auxiliary_off_power_w: AuxiliaryPower | None = None
    road_load: RoadLoadFile
    braking: BrakingFile | None = None
