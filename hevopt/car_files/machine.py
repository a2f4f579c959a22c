"""What an electric machine's file may hold: limits, and loss by efficiency, coefficients or a measured map."""

from typing import Annotated, Literal, Self

import numpy as np
from pydantic import ConfigDict, Field, model_validator

from hevopt.car_files.fields import (
    Curve,
    Fraction,
    FullLoadFile,
    KeysOfKind,
    Name,
    NotNegative,
    Positive,
    ScaleFile,
    Specific,
    Speeds,
    check_grid,
)
from hevopt.files.toml import FileModel


class LossMapFile(FileModel):
    """A measured map: rows are speeds, columns torques; nan marks a cell that was not measured.

    symmetric: torque_nm holds values from 0 up, and the loss is the same at the opposite torque.
    """

    speed_rpm: Speeds
    torque_nm: Curve
    loss_w: list[list[Annotated[float, Field(allow_inf_nan=True)]]]
    symmetric: bool = False

    @model_validator(mode="after")
    def _shapes(self) -> Self:
        check_grid("loss_w", self.loss_w, len(self.speed_rpm), len(self.torque_nm))
        if (np.diff(self.speed_rpm) <= 0).any() or (np.diff(self.torque_nm) <= 0).any():
            raise ValueError("speed_rpm and torque_nm must increase")
        if self.symmetric and self.torque_nm[0] < 0:
            raise ValueError(
                f"symmetric needs torque_nm from 0 up, found {self.torque_nm[0]:g}; with torques of "
                "both signs leave symmetric out"
            )
        return self


_KEYS_OF_KIND = KeysOfKind(
    {
        "loss": {"loss_c0_w", "loss_c1_ws", "loss_c2_ws2", "loss_c3_wpnm2"},
        "efficiency": {"efficiency"},
        "map": {"loss_map"},
    },
    {},
)


class MachineFile(FileModel):
    model_config = ConfigDict(json_schema_extra=_KEYS_OF_KIND.schema())

    name: Name
    kind: Literal["loss", "efficiency", "map"]
    power_max_w: Positive
    torque_max_nm: Positive | None = None
    speed_max_rpm: Positive | None = None
    full_load: FullLoadFile | None = None
    inertia_kgm2: Annotated[float, Field(ge=0, le=100)] = 0.0
    spin_efficiency: Fraction = 0.85
    efficiency: Fraction | None = None
    loss_c0_w: NotNegative | None = None
    loss_c1_ws: NotNegative | None = None
    loss_c2_ws2: NotNegative | None = None
    loss_c3_wpnm2: NotNegative | None = None
    loss_map: LossMapFile | None = None
    mass_kgpkw: Specific | None = None
    price_pkw: Specific | None = None
    scale: ScaleFile | None = None

    @model_validator(mode="after")
    def _keys_of_kind(self) -> Self:
        given = {key for key in self.model_fields_set if getattr(self, key) is not None}
        _KEYS_OF_KIND.check(self.kind, given)
        return self
