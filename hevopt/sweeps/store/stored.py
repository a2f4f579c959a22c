"""What a store's tables hold, checked as they are read: a damaged file may well be a good database."""

from collections.abc import Mapping, Sequence
from functools import reduce
from operator import or_
from pathlib import Path
from types import NoneType
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self, get_args, get_type_hints

from pydantic import BaseModel, ConfigDict, Field, ValidationError, create_model, model_validator

from hevopt.bounds.claim import Claim
from hevopt.errors import DataError
from hevopt.files.lookup import loaded_json
from hevopt.studies.rows import Row
from hevopt.studies.status import Status
from hevopt.sweeps.plan.jobs import BOUND, SOLVED, Ending

_STRICT = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False)
# Far beyond any figure, and far from where sums and squares of floats end.
_FIGURE_MAX, _NUMBER_MAX, _WEIGHT_MAX = 1e100, 1e15, 1e6
_DESIGN_MAX = 2**31
_NAME_MAX, _KEYS_MAX = 5000, 100

_Figure = Annotated[float, Field(ge=-_FIGURE_MAX, le=_FIGURE_MAX)]
_Design = Annotated[int, Field(ge=0, le=_DESIGN_MAX)]
_Name = Annotated[str, Field(max_length=_NAME_MAX)]
_Scalar = (
    bool
    | Annotated[int, Field(ge=-_NUMBER_MAX, le=_NUMBER_MAX)]
    | Annotated[float, Field(ge=-_NUMBER_MAX, le=_NUMBER_MAX)]
    | _Name
)
_OF_ROWS = {
    str: _Name,
    Status: _Name,
    Claim: _Name,
    float: _Figure,
    int: Annotated[int, Field(ge=0, le=_NUMBER_MAX)],
}


class _Fields(BaseModel):
    """Columns of a table, or keys of a row."""

    model_config = _STRICT


def _field(hint: Any) -> Any:
    """The annotation and default of a stored row's key, of the hint of `Row`'s field."""
    kinds = get_args(hint) or (hint,)
    allowed = reduce(or_, (_OF_ROWS.get(kind, kind) for kind in kinds))
    return (allowed, None) if NoneType in kinds else allowed


if TYPE_CHECKING:
    _Ending = str
else:
    _Ending = Literal[tuple(map(str, Ending))]
_AnyRow: Any = create_model(
    "_AnyRow",
    __base__=_Fields,
    **{name: _field(hint) for name, hint in get_type_hints(Row).items()},
)


class _StoredRow(_AnyRow):  # type: ignore[misc]
    """The figures of a row, None for those it does not have; keys of other versions are passed over."""

    model_config = ConfigDict(extra="ignore")
    architecture: _Name | None = None
    bound_l_per_100km: _Figure
    objective_l_per_100km: _Figure | None
    objective_bound_l_per_100km: _Figure
    lost_proofs: Annotated[dict[_Name, str], Field(max_length=_KEYS_MAX)] | None = None


class _StoredFailure(_Fields):
    headline: str
    details: str


class _StoredCase(_Fields):
    design: _Design
    parameters: Annotated[dict[_Name, _Scalar], Field(max_length=_KEYS_MAX)]
    cycle: _Name
    strategy: _Name
    nox_weight: Annotated[float, Field(ge=0, le=_WEIGHT_MAX)]
    ending: _Ending
    row: _StoredRow | None
    failure: _StoredFailure | None
    seconds: Annotated[float, Field(ge=0, le=_NUMBER_MAX)] | None

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        stored = self.ending in SOLVED
        if (self.seconds is not None) != stored:
            raise ValueError(f"a case cannot be stored as {self.ending}")
        if (self.row is not None) != (self.ending == Ending.OK):
            raise ValueError("a row belongs to each case that is ok, and to no other")
        if (self.failure is not None) != (stored and self.ending != Ending.OK):
            raise ValueError("a failure belongs to each case that has no row, and to no other")
        if (
            self.row is not None
            and self.strategy != BOUND
            and None
            in (
                self.row.fuel_l_per_100km,
                self.row.fuel_corrected_l_per_100km,
                self.row.objective_l_per_100km,
            )
        ):
            raise ValueError("a strategy's row needs fuel and objective")
        return self


class _StoredPruned(_Fields):
    design: _Design
    bound: _Figure
    incumbent: _Design
    objective: _Figure


class _StoredMeta(_Fields):
    meta: dict[str, str]


class _StoredLists(_Fields):
    """Name -> digest or version."""

    inputs: dict[str, str] = {}
    versions: dict[str, str] = {}


def loaded(path: Path, text: Any) -> Any:
    """What a JSON text of a store holds, None for none; DataError where it is damaged."""
    try:
        return None if text is None else loaded_json(text)
    except (ValueError, TypeError, RecursionError):
        raise damaged(path, "a text in it is no JSON") from None


def check_case(path: Path, values: Mapping[str, Any], keys: Sequence[str] | None) -> None:
    """DataError where a case is none that a sweep wrote; keys: of the parameters of the design before."""
    _check(path, _StoredCase, values)
    if keys is not None and list(values["parameters"]) != list(keys):
        raise damaged(path, f"design {values['design']} has other parameters")


def known_figures(row: Mapping[str, Any] | None) -> dict[str, Any] | None:
    """A row without the keys of other versions."""
    return (
        None
        if row is None
        else {name: value for name, value in row.items() if name in _StoredRow.model_fields}
    )


def check_pruned(path: Path, values: Mapping[str, Any]) -> None:
    """DataError where a pruned design is none that a sweep wrote."""
    _check(path, _StoredPruned, values)


def check_meta(path: Path, meta: Mapping[str, Any]) -> None:
    """DataError where what is known of a sweep is not text, or its lists are not JSON objects."""
    _check(path, _StoredMeta, {"meta": meta})
    lists = {name: loaded(path, meta[name]) for name in ("inputs", "versions") if name in meta}
    _check(path, _StoredLists, lists)


def _check(path: Path, model: type[BaseModel], values: Mapping[str, Any]) -> None:
    try:
        model.model_validate(values)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        place = ".".join(str(part) for part in first["loc"][:2] if str(part).isprintable())
        raise damaged(path, f"{place[:80]}: {first['msg']}") from None


def damaged(path: Path, what: str) -> DataError:
    """The error of a store that holds what no sweep wrote."""
    return DataError(
        f"{path}: damaged ({what}); name a copy of before, or a new store and run the sweep again"
    )
