"""Reading a saved comparison: unpacked within bounds, and checked before anything is drawn from it."""

import json
import zlib
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from hevopt.errors import DataError
from hevopt.files import printable
from hevopt.pages.results import FORMAT, Results

_MEGABYTES_MAX = 500
_MAGIC = b"\x1f\x8b"
_FAULTS_LISTED = 5


def load_results(path: Path) -> Results:
    """Results from a saved file; DataError says what is wrong with it."""
    try:
        results = Results.model_validate(_contents(path))
        faults = _disagreements(results)
    except ValidationError as error:
        results = None
        faults = [
            f"{printable('.'.join(map(str, fault['loc'])))[:120]}: {fault['msg'].lower()}"
            for fault in error.errors(include_input=False, include_url=False)
        ]
    if results is None or faults:
        raise DataError(
            f"{path}: not a saved comparison ({'; '.join(faults[:_FAULTS_LISTED])}); give a file written by "
            "hevopt compare --save"
        )
    return results


def _disagreements(results: Results) -> list[str]:
    """Rows whose car is missing, and traces that are not as long as their cycle."""
    faults = []
    for n, row in enumerate(results.rows):
        if row.detail is None:
            continue
        car = results.cars.get(row.figures.architecture)
        if car is None:
            faults.append(f"rows.{n}: no car {printable(row.figures.architecture)!r}")
            continue
        steps, trace = len(car.time_s), row.detail.trace.model_dump()
        lengths = {len(values) - (name == "soc") for name, values in trace.items()}
        if lengths != {steps} or max(trace["operation"], default=0) >= len(results.operations):
            faults.append(f"rows.{n}.detail.trace: not of {steps} steps, as car {car.name} has")
    return faults


def _contents(path: Path) -> Any:
    advice = "give a file written by hevopt compare --save"
    try:
        packed = path.read_bytes()
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror}); check the path") from None
    try:
        unpacker = zlib.decompressobj(wbits=31)
        text = packed
        if packed.startswith(_MAGIC):
            text = unpacker.decompress(packed, _MEGABYTES_MAX * 1_000_000)
            if not unpacker.eof:
                raise DataError(f"{path}: cut short, or beyond {_MEGABYTES_MAX} MB; {advice}")
        contents = json.loads(text)
    except (zlib.error, ValueError, RecursionError):
        raise DataError(f"{path}: neither JSON nor JSON packed with gzip; {advice}") from None
    if not isinstance(contents, dict) or contents.get("format") != FORMAT:
        raise DataError(f"{path}: not in the form {FORMAT!r}; {advice} of this version")
    return contents
