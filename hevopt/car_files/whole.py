"""A car's contents as files of their own: what its files and the changes on reading made, and nothing shipped."""

from collections.abc import Mapping
from typing import Any

from hevopt.car.architecture import Architecture
from hevopt.car_files.kinds import COMPONENTS
from hevopt.car_files.template import toml_value

ARCHITECTURE = "architecture.toml"


def texts_of(car: Architecture) -> dict[str, str]:
    """File -> text of an architecture and its components, which `load_architecture` reads as the same car.

    Changes that were made on reading, and the mass that resized parts then had, are in them.
    """
    own, texts = dict(car.contents), {}
    own["hybrid_mass_kg"] = own.get("hybrid_mass_kg", 0.0) + car.added_kg
    for key in COMPONENTS:
        if key in own:
            texts[f"{key}.toml"] = _text(own[key])
            own[key] = f"./{key}.toml"
    return {ARCHITECTURE: _text(own), **texts}


def _text(contents: Mapping[str, Any]) -> str:
    return "".join(f"{key} = {toml_value(value)}\n" for key, value in contents.items())
