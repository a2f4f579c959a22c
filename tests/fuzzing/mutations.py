"""Ways to spoil a file, each a function of its bytes and a random generator."""

import random
import re
from collections.abc import Callable

Mutation = Callable[[bytes, random.Random], bytes]
_NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?")
_QUOTED = re.compile(rb"\"[^\"\n]*\"|'[^'\n]*'")
_LIST = re.compile(rb"= \[([^\[\]\n]+)\]")
# Files of the corpus, and names and folders that are something else than what was named.
_NAMES = (
    "./study.toml", "./sweep.toml", "./car.toml", "./part.toml", "./drive.csv", "engine.csv", "./log.mat", ".",
    "..", "/", "/dev/null", "C2", "A", "nedc", "engine_diesel_1600", "battery_liion_64", "bound", "dp", "all",
)  # fmt: skip
_ODD_NUMBERS = (
    b"nan", b"inf", b"-inf", b"1e308", b"-1e308", b"1e-320", b"9" * 400, b"0x1F", b"1_000", b"1,5", b"--3",
    b"", b"true", b"-0.0", b"1e99999", b"18446744073709551616", "١٢".encode(), b"=1+1",
)  # fmt: skip
_ODD_TEXTS = (
    b"\x00", b"\x1b[2J\x1b[31m", b"<script>alert(1)</script>", b'"', b"'''", b"[[", b"]]", b"{", b"\r", b"\n\n",
    b"\xff\xfe", b"\xef\xbb\xbf", "\u202e".encode(), b"../../etc/passwd", b"%s%n", b"#", b"=", b";;;", b",,,",
)  # fmt: skip
_LONG_LINE_BYTES = 2_000_000


def truncated(data: bytes, rng: random.Random) -> bytes:
    return data[: rng.randrange(len(data) + 1)]


def bits_flipped(data: bytes, rng: random.Random) -> bytes:
    spoilt = bytearray(data)
    for _ in range(rng.choice((1, 3, 30))):
        if spoilt:
            spoilt[rng.randrange(len(spoilt))] ^= 1 << rng.randrange(8)
    return bytes(spoilt)


def number_replaced(data: bytes, rng: random.Random) -> bytes:
    return _replaced(data, rng, rng.choice(_ODD_NUMBERS))


def number_scaled(data: bytes, rng: random.Random) -> bytes:
    factor = rng.choice((-1, 0, 1e-6, 10, 1e3, 1e6, 1e12))
    return _replaced(data, rng, lambda found: b"%g" % (float(found.group()) * factor))


def _replaced(data: bytes, rng: random.Random, new) -> bytes:
    places = list(_NUMBER.finditer(data))
    if not places:
        return data
    for place in sorted(
        rng.sample(places, min(len(places), rng.choice((1, 2, 10)))), key=lambda m: -m.start()
    ):
        text = new(place) if callable(new) else new
        data = data[: place.start()] + text + data[place.end() :]
    return data


def text_inserted(data: bytes, rng: random.Random) -> bytes:
    place = rng.randrange(len(data) + 1)
    return data[:place] + rng.choice(_ODD_TEXTS) * rng.choice((1, 1, 50)) + data[place:]


def lines_shuffled(data: bytes, rng: random.Random) -> bytes:
    lines = data.split(b"\n")
    rng.shuffle(lines)
    return b"\n".join(lines)


def lines_removed(data: bytes, rng: random.Random) -> bytes:
    lines = data.split(b"\n")
    first = rng.randrange(len(lines))
    return b"\n".join(lines[:first] + lines[first + rng.choice((1, 2, 40)) :])


def lines_repeated(data: bytes, rng: random.Random) -> bytes:
    lines = data.split(b"\n")
    first = rng.randrange(len(lines))
    return b"\n".join(lines[: first + 1] + lines[first:])


def columns_swapped(data: bytes, rng: random.Random) -> bytes:
    separator = max((b",", b";", b"\t"), key=data.count)
    a, b = rng.randrange(4), rng.randrange(4)
    swapped = []
    for line in data.split(b"\n"):
        cells = line.split(separator)
        if max(a, b) < len(cells):
            cells[a], cells[b] = cells[b], cells[a]
        swapped.append(separator.join(cells))
    return b"\n".join(swapped)


def column_removed(data: bytes, rng: random.Random) -> bytes:
    separator, gone = max((b",", b";", b"\t"), key=data.count), rng.randrange(3)
    rows = [line.split(separator) for line in data.split(b"\n")]
    return b"\n".join(separator.join(c for n, c in enumerate(row) if n != gone) for row in rows)


def other_separator(data: bytes, rng: random.Random) -> bytes:
    return data.replace(b",", rng.choice((b";", b"\t", b" ", b"|", b", ", b"")))


def other_line_ends(data: bytes, rng: random.Random) -> bytes:
    return data.replace(b"\n", rng.choice((b"\r", b"\r\n", b"\n\n", b"\x0b", b"\x85", b"")))


def other_encoding(data: bytes, rng: random.Random) -> bytes:
    text = data.decode("utf-8", "replace")
    coding = rng.choice(("utf-16", "utf-16-le", "utf-32", "cp1252", "utf-8-sig", "cp037"))
    return text.encode(coding, "replace")


def emptied(data: bytes, rng: random.Random) -> bytes:
    return rng.choice((b"", b"\n", b" " * 1000, b"#\n", b"\xef\xbb\xbf", b"\x00" * 100))


def binary(data: bytes, rng: random.Random) -> bytes:
    magic = rng.choice(
        (b"", b"PK\x03\x04", b"MATLAB 5.0", b"\x1f\x8b\x08", b"\x89HDF\r\n", b"SQLite format 3\0")
    )
    return magic + rng.randbytes(rng.choice((10, 1000, 100_000)))


def nested_deeply(data: bytes, rng: random.Random) -> bytes:
    depth = rng.choice((100, 5000, 200_000))
    opened, closed = rng.choice(((b"[", b"]"), (b"{a=", b"}"), (b"(", b")")))
    deep = b"\nx = " + opened * depth + b"1" + closed * depth
    return rng.choice((data + deep, deep, b"[" + b"a." * depth + b"a]\n"))


def line_very_long(data: bytes, rng: random.Random, size: int = _LONG_LINE_BYTES) -> bytes:
    unit = rng.choice((b"1,", b"a", b'"', b"1;", b"9", b" ", b"[", b"\\"))
    long = unit * (size // len(unit))
    return rng.choice((long, data + long, long + b"\n" + data))


def line_of_100_megabytes(data: bytes, rng: random.Random) -> bytes:
    return line_very_long(data, rng, 99_000_000)


def name_replaced(data: bytes, rng: random.Random) -> bytes:
    """A text in quotes becomes the name of some file, perhaps of the spoilt one itself."""
    places = list(_QUOTED.finditer(data))
    if not places:
        return data
    place = rng.choice(places)
    name = b'"' + rng.choice(_NAMES).encode() + b'"'
    return data[: place.start()] + name + data[place.end() :]


def entries_repeated(data: bytes, rng: random.Random) -> bytes:
    """The entries of a list on one line, two or thousands of times."""
    places = [found for found in _LIST.finditer(data) if len(found[1]) < 10_000]
    if not places:
        return data
    place = rng.choice(places)
    entries = b", ".join([place[1].rstrip(b", ")] * rng.choice((2, 3, 5000)))
    return data[: place.start(1)] + entries + data[place.end(1) :]


def column_blanked(data: bytes, rng: random.Random) -> bytes:
    """Some lines lose what they have in one column."""
    separator, column = max((b",", b";", b"\t"), key=data.count), rng.randrange(5)
    lines = data.split(b"\n")
    first = rng.randrange(len(lines))
    for n in range(first, min(first + rng.choice((1, 5, 1000)), len(lines))):
        cells = lines[n].split(separator)
        if column < len(cells):
            cells[column] = b""
            lines[n] = separator.join(cells)
    return b"\n".join(lines)


COMMON: tuple[Mutation, ...] = (
    truncated, bits_flipped, number_replaced, number_scaled, text_inserted, lines_shuffled, lines_removed,
    lines_repeated, columns_swapped, column_removed, other_separator, other_line_ends, other_encoding, emptied,
    binary, nested_deeply, line_very_long, name_replaced, entries_repeated, column_blanked,
)  # fmt: skip
# Once in so many cases, because each takes seconds to write and read.
RARE: tuple[Mutation, ...] = (line_of_100_megabytes,)
RARE_EVERY = 250
