"""Which values the settings of a comparison may have."""

from collections import Counter
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, Strict

from hevopt.files.shown import shown

NAMES_MAX = 1000
_NEUTRAL = "neutral"


def _soc_end(value: Any) -> Any:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if value != _NEUTRAL and not (number and 0 <= value <= 1):
        raise ValueError(f'allowed: "{_NEUTRAL}" (that of the start), or 0 to 1')
    return value


def _each_once(names: tuple[str, ...]) -> tuple[str, ...]:
    if not names:
        raise ValueError("name at least one, or leave it out for the usual ones")
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        raise ValueError(f"{shown(twice[0])} is given twice; give it once")
    return names


Names = Annotated[
    tuple[str, ...], Strict(False), Field(max_length=NAMES_MAX), AfterValidator(_each_once)
]
SocEnd = Annotated[float | Literal["neutral"], BeforeValidator(_soc_end)]
NoxWeight = Annotated[float, Field(ge=0, le=1e6)]
Horizon = Annotated[float, Field(ge=1e-3, le=1e6)]
