"""What a store's tables hold, checked as they are read: a damaged file may well be a good database."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import NoneType
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator

from hevopt.errors import DataError
from hevopt.sweeps.jobs import BOUND

OUTCOMES = ("ok", "infeasible", "failed", "pruned", "missing")
_STRICT = ConfigDict(strict=True, extra="allow", allow_inf_nan=False)


class _StoredRow(BaseModel):
    """The figures of a row that pages and tables reckon with, None for those it does not have."""

    model_config = _STRICT
    strategy: str
    status: str
    bound_l_per_100km: float
    fuel_l_per_100km: float | None
    fuel_corrected_l_per_100km: float | None
    nox_mg_per_km: float | None = None
    objective_l_per_100km: float | None
    objective_bound_l_per_100km: float

    @model_validator(mode="after")
    def _solved(self):
        fuel = self.fuel_l_per_100km, self.fuel_corrected_l_per_100km
        if self.strategy != BOUND and None in (*fuel, self.objective_l_per_100km):
            raise ValueError("a strategy's row needs fuel and objective")
        return self


class _StoredCase(BaseModel):
    model_config = _STRICT
    design: int
    parameters: dict[str, bool | int | float | str]
    cycle: str
    strategy: str
    nox_weight: float
    outcome: Literal[OUTCOMES]
    row: _StoredRow | None
    error: str | None
    seconds: float | None


class _StoredPruned(BaseModel):
    model_config = _STRICT
    design: int
    bound: float
    incumbent: int
    objective: float


class _StoredMeta(BaseModel):
    model_config = _STRICT
    meta: dict[str, str | None]


def loaded(path: Path, text: Any) -> Any:
    """What a JSON text of a store holds, None for none; DataError where it is damaged."""
    try:
        return None if text is None else json.loads(text)
    except (ValueError, TypeError, RecursionError):
        raise _damaged(path, "a text in it is no JSON") from None


def check_case(path: Path, values: Mapping[str, Any], keys: Sequence[str] | None) -> None:
    """DataError where a case is none that a sweep wrote; keys: of the parameters of the design before."""
    _check(path, _StoredCase, values)
    if keys is not None and list(values["parameters"]) != list(keys):
        raise _damaged(path, f"design {values['design']} has other parameters")


def check_pruned(path: Path, values: Mapping[str, Any]) -> None:
    """DataError where a pruned design is none that a sweep wrote."""
    _check(path, _StoredPruned, values)


def check_meta(path: Path, meta: Mapping[str, Any]) -> None:
    """DataError where what is known of a sweep is not text, or its lists are not JSON objects."""
    _check(path, _StoredMeta, {"meta": meta})
    for name in ("inputs", "versions"):
        if not isinstance(loaded(path, meta.get(name)), dict | NoneType):
            raise _damaged(path, f"{name} is no list of names")


def _check(path: Path, model: type[BaseModel], values: Mapping[str, Any]) -> None:
    try:
        model.model_validate(values)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        place = ".".join(str(part) for part in first["loc"][:2] if str(part).isprintable())
        raise _damaged(path, f"{place[:80]}: {first['msg']}") from None


def _damaged(path: Path, what: str) -> DataError:
    return DataError(
        f"{path}: damaged ({what}); name a copy of before, or a new store and run the sweep again"
    )
