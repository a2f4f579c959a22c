"""A short drive, files of it, and what an import makes of them."""

from pathlib import Path

import pytest

from hevopt.errors import DataError
from hevopt.measured.cycles.cycle import import_cycle

# With a standstill, in km/h at whole seconds.
DRIVE_KMH = [0, 0, 9, 18, 27, 36, 36, 27, 9, 0, 0, 0, 18, 36, 18, 0]
PLAIN = "".join(f"{t},{v}\n" for t, v in enumerate(DRIVE_KMH))


def imported(tmp_path: Path, text: str, name="drive.csv", **options):
    path = tmp_path / name
    path.write_text(text)
    return import_cycle(path, **options)


def refusal(tmp_path, text, name="drive.csv", **options):
    with pytest.raises(DataError) as error:
        imported(tmp_path, text, name, **options)
    return str(error.value)


def columns(text):
    """The cycle file without its comments."""
    return "\n".join(line for line in text.splitlines() if not line.startswith("#"))
