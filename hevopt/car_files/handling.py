"""What an architecture's file may say of tyres, clutch, gear changes and driver, which only a driven car shows.

What is left out is that of hevopt.car.handling, where every default stands with its source.
"""

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from hevopt.car.handling import RANGES, Clutch, DriverGains, Handling, Shifting, Tyre
from hevopt.files.toml import FileModel

Gain = Annotated[float, Field(ge=0, le=1000)]
Lag = Annotated[float, Field(ge=0.01, le=10)]


def _within(key: str) -> Any:
    low, high = RANGES[key]
    return Field(ge=low, le=high)


class TyreFile(FileModel):
    """The driven tyres."""

    lag_s: Annotated[float, _within("lag_s")] | None = None
    friction: Annotated[float, _within("friction")] | None = None
    driven_share: Annotated[float, _within("driven_share")] | None = None
    height_share: Annotated[float, _within("height_share")] | None = None
    law: Literal["lag", "pacejka"] | None = None
    stiffness: Annotated[float, _within("stiffness")] | None = None
    shape: Annotated[float, _within("shape")] | None = None
    curvature: Annotated[float, _within("curvature")] | None = None
    relaxation_m: Annotated[float, _within("relaxation_m")] | None = None

    @model_validator(mode="after")
    def _check_law(self) -> "TyreFile":
        """Only keys that the law reads, and a peak of the force."""
        of_slip = ("stiffness", "shape", "curvature", "relaxation_m")
        read, law = ("lag_s",) if self.law == "pacejka" else of_slip, self.law or "lag"
        if unread := [key for key in read if getattr(self, key) is not None]:
            other = "lag" if self.law == "pacejka" else "pacejka"
            raise ValueError(
                f'{", ".join(unread)}: not read with law {law!r}; leave it out, or give law = "{other}"'
            )
        if law == "pacejka" and not tyre_of(self).peaks:
            raise ValueError(
                "the force has no peak up to a slip of 1; raise shape or stiffness, or lower curvature"
            )
        return self


class ClutchFile(FileModel):
    """The driver's clutch."""

    slipping_nm: Annotated[float, _within("slipping_nm")] | None = None
    sticking_nm: Annotated[float, _within("sticking_nm")] | None = None
    slip_scale_radps: Annotated[float, _within("slip_scale_radps")] | None = None
    closing_s: Annotated[float, _within("closing_s")] | None = None


class ShiftingFile(FileModel):
    """How a gear is changed."""

    gap_s: Annotated[float, _within("gap_s")] | None = None
    ratio_lag_s: Annotated[float, _within("ratio_lag_s")] | None = None
    between_s: Annotated[float, _within("between_s")] | None = None
    reversal_s: Annotated[float, _within("reversal_s")] | None = None


class DriverFile(FileModel):
    """Who is at the pedals."""

    proportional: Gain | None = None
    integral: Gain | None = None
    derivative: Gain | None = None
    feed_forward: Annotated[float, Field(ge=0, le=2)] | None = None
    preview_s: Annotated[float, Field(ge=0, le=10)] | None = None
    hold_mps: Annotated[float, Field(ge=0, le=2)] | None = None
    governor_s: Lag | None = None
    start_s: Lag | None = None
    stop_s: Lag | None = None
    charge_per_s: Annotated[float, Field(ge=0, le=10)] | None = None


def handling_of(
    tyre: TyreFile | None,
    clutch: ClutchFile | None,
    shifting: ShiftingFile | None,
    driver: DriverFile | None,
    gap_s: float,
) -> Handling:
    """A car's handling by the tables of its file; gap_s: of a change of gear where [shifting] gives none."""
    return Handling(
        Tyre() if tyre is None else tyre_of(tyre),
        Clutch(**_given(clutch)),
        None if shifting is None else Shifting(**{"gap_s": gap_s, **_given(shifting)}),
        DriverGains(**_given(driver)),
    )


def tyre_of(table: TyreFile) -> Tyre:
    """The tyres of a file."""
    given = _given(table)
    slips = given.pop("law", "lag") == "pacejka"
    return Tyre(**given, slips=slips)


def _given(table: FileModel | None) -> dict[str, Any]:
    return {} if table is None else table.model_dump(exclude_none=True)
