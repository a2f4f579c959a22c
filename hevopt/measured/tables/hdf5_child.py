"""A program of its own that reads an HDF5 file from standard input: of a spoilt one only this process is lost.

It imports nothing of hevopt. To standard output go, of every variable, a line of JSON with its name and shape (null
where it is no matrix of real numbers), and its numbers as 8-byte floats row by row; of a file that is too large or
cannot be read a line with "fault" is the last.
"""

import json
import resource
import sys
from collections.abc import Iterator

import h5py
import numpy as np

_MEMORY_MAX = 3_000_000_000
_CPU_MAX_S = 8
_BYTES_MAX = 200_000_000
_INTEGERS = [f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)]
_NUMBERS = ("double", "single", "logical", *_INTEGERS)


def main() -> None:
    """Standard input to standard output."""
    for limit, value in (
        (resource.RLIMIT_AS, _MEMORY_MAX),
        (resource.RLIMIT_CPU, _CPU_MAX_S),
        (resource.RLIMIT_CORE, 0),
    ):
        hard = resource.getrlimit(limit)[1]
        value = value if hard == resource.RLIM_INFINITY else min(value, hard)
        resource.setrlimit(limit, (value, value))
    written = 0
    try:
        image = h5py.h5f.open_file_image(sys.stdin.buffer.read())
        for name, found in _variables(h5py.File(image)):
            written += 0 if found is None else 8 * found.size
            if written > _BYTES_MAX:
                _say({"fault": "size"})
                return
            values = None if found is None else _matrix(found)
            _say({"name": name, "shape": None if values is None else values.shape})
            if values is not None:
                sys.stdout.buffer.write(values.tobytes())
    except Exception as error:
        _say({"fault": type(error).__name__})


def _say(line: dict) -> None:
    sys.stdout.buffer.write(json.dumps(line).encode() + b"\n")
    sys.stdout.buffer.flush()


def _variables(group: h5py.Group, prefix: str = "") -> Iterator[tuple[str, h5py.Dataset | None]]:
    """Name and data of every variable, of a structure those of its fields; None where it holds no real numbers."""
    for key in group:
        # Other links may lead to other files.
        if key.startswith("#") or not isinstance(group.get(key, getlink=True), h5py.HardLink):
            continue
        item = group[key]
        is_group = isinstance(item, h5py.Group)
        if is_group and not prefix and "MATLAB_sparse" not in item.attrs:
            yield from _variables(item, f"{key}.")
        else:
            yield prefix + key, None if is_group or not _is_real(item) else item


def _is_real(item: object) -> bool:
    """Whether it is a scalar, vector or matrix of real numbers that lies in the file itself."""
    return (
        isinstance(item, h5py.Dataset)
        and _class(item) in ("", *_NUMBERS)
        and not item.attrs.get("MATLAB_empty", 0)
        and item.dtype.kind in "iufb"
        and item.ndim <= 2
        and not item.is_virtual
        and not item.external
    )


def _class(item: h5py.Dataset) -> str:
    """MATLAB's word for the type, '' where another program wrote the file."""
    word = item.attrs.get("MATLAB_class", "")
    return word if isinstance(word, str) else bytes(word).decode("latin-1")


def _matrix(item: h5py.Dataset) -> np.ndarray:
    """Rows and columns as MATLAB has them: in its files the axes are the other way round."""
    values = np.asarray(item[()], dtype="<f8")
    return (
        values.T
        if values.ndim == 2 and _class(item)
        else values.reshape(len(np.atleast_1d(values)), -1)
    )


if __name__ == "__main__":
    main()
