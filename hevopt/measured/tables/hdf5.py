"""MATLAB files of version 7.3, which are HDF5, to variables.

The HDF5 library crashes, hangs or takes all memory on some spoilt files; it works in a process of its own, within
limits of memory and time, and what becomes of that process is a message (hdf5_child.py).
"""

import json
import os
import subprocess
import sys
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hevopt.errors import DataError

_CHILD = Path(__file__).with_name("hdf5_child.py")
# The child ends itself after seconds of work; this is for one that sleeps.
_TIMEOUT_S = 300
_OTHERWISE = "save it with save(..., '-v7'), or as CSV"


def hdf5_variables(path: Path, contents: bytes) -> dict[str, NDArray | None]:
    """The variables of a .mat file of version 7.3; DataError where h5py is missing or cannot read it."""
    if find_spec("h5py") is None:
        raise DataError(
            f'{path}: a .mat file of version 7.3 (HDF5), which needs h5py; run: pip install "hevopt[hdf5]", or '
            f"{_OTHERWISE}"
        )
    # One thread, as each takes address space, and no filters from elsewhere.
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "HDF5_PLUGIN_PRELOAD": "::"}
    try:
        ended = subprocess.run(
            [sys.executable, "-P", _CHILD],
            input=contents,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=environment,
            timeout=_TIMEOUT_S,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise _unreadable(path, type(error).__name__) from None
    if ended.returncode:
        raise _unreadable(path, f"the reader ended with status {ended.returncode}")
    return _variables(path, BytesIO(ended.stdout))


def _variables(path: Path, stream: BytesIO) -> dict[str, NDArray | None]:
    variables: dict[str, NDArray | None] = {}
    while line := stream.readline():
        said = json.loads(line)
        if said.get("fault") == "size":
            raise DataError(f"{path}: more than 200 MB unpacked; save fewer variables")
        if "fault" in said:
            raise _unreadable(path, said["fault"])
        shape, values = said["shape"], None
        if shape is not None:
            count = shape[0] * shape[1]
            values = np.frombuffer(stream.read(8 * count), "<f8", count).reshape(shape)
        variables[said["name"]] = values
    return variables


def _unreadable(path: Path, why: str) -> DataError:
    return DataError(f"{path}: not a readable .mat file of version 7.3 ({why}); {_OTHERWISE}")
