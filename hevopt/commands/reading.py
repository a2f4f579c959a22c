"""What `hevopt compare` reads, by another process where there is a processor for it."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from hevopt.driving.cycle import Cycle
    from hevopt.studies.cars import Cars
    from hevopt.studies.settings import Settings


class Read(NamedTuple):
    """What a comparison reads: settings, cars, cycle, and whether these two are those of the published study, as
    shipped."""

    settings: "Settings"
    cars: "Cars"
    trace: "Cycle"
    is_study: bool


def read_ahead(
    options: Mapping[str, Any], place: str, study_path: Path | None
) -> "Callable[[], Read]":
    """What gives all that a comparison of a study file, and of options on top, reads, or the error of reading it.

    Another process reads it, where there is a processor for it, so that this one can load what computes; what
    checks and reads files, which takes as long to load, is then nowhere but there.
    place: how a message names the options
    """
    # Both need these.
    from hevopt.driving.cycle import load_cycle
    from hevopt.studies.cars import cars_of
    from hevopt.studies.halves import ahead

    def read() -> Read:
        from hevopt.reproduction.published import CYCLE, is_study
        from hevopt.studies.given import given_of, joined, study_of
        from hevopt.studies.study_file import read_study

        below = {"set": {}} if study_path is None else read_study(study_path)
        asked = study_of(joined(below, given_of(place, options)))
        cars = cars_of(asked.architectures, asked.settings)
        trace = load_cycle(asked.cycle)
        shipped = asked.architectures is None and asked.cycle == CYCLE
        as_shipped = shipped and not asked.settings.free_gear and not any(cars.changes.values())
        # Else all of the study would have to be read once more.
        return Read(asked.settings, cars, trace, as_shipped or is_study(cars.cars, trace))

    return ahead(read)
