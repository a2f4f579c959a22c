"""What asks for NOx needs an engine with data on it. Who plans a sweep asks it, and loads nothing that solves."""

from hevopt.car.architecture import Architecture
from hevopt.errors import UnknownNoxError
from hevopt.files.shown import printable


def require_nox(car: Architecture, asking: str) -> None:
    """UnknownNoxError where the car's engine has no data on NOx; `asking` is how a message names what needs it."""
    if not car.engine.nox_known:
        raise UnknownNoxError(
            f"{car.name}: {asking} needs NOx data, but engine {printable(car.engine.name)!r} has none; "
            "add nox_gps to its fuel_map, or nox_coefficients, or leave NOx out"
        )
