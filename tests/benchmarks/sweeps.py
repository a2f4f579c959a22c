"""Speed of sweeps from the command to the last stored row, written to reports/benchmarks_sweeps.md:

    python tests/benchmarks/sweeps.py

On an idle machine; about ten minutes on two cores. Every run is `hevopt sweep` as a process of its own, its workers
included, with compiled parts in the cache.
"""

import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from hevopt.studies.provenance import versions
from hevopt.sweeps.store.reading import open_to_read

OUT = Path(__file__).parents[2] / "reports" / "benchmarks_sweeps.md"
DESIGNS = """architecture = "C2"
cycles = ["nedc"]
strategies = {strategies}
[parameters]
battery.cells_in_series = {{ from = 40, to = 130, count = {cells} }}
machine.power_max_w = {{ from = 9e3, to = 27e3, count = {powers} }}
nox_weight = {weights}
"""
TENS = [0, 2, 4, 6, 8, 10, 15, 20, 30, 40]
RUNS = (
    ("one worker, loky", "--jobs", "1"),
    ("two workers, loky", "--jobs", "2"),
    ("two workers, dask (LocalCluster, two processes)", "--jobs", "2", "--backend", "dask"),
    ("two workers, ray (local)", "--jobs", "2", "--backend", "ray"),
)


def study(folder: Path, name: str, **values: object) -> Path:
    """A study file of C2 on the NEDC."""
    path = folder / f"{name}.toml"
    path.write_text(DESIGNS.format(**values))
    return path


def sweep(path: Path, store: Path, *options: str) -> float:
    """Seconds that a sweep took, from start to end of its process."""
    command = [sys.executable, "-m", "hevopt.cli", "sweep", str(path), "--store", str(store)]
    began = time.perf_counter()
    subprocess.run([*command, *options], check=True, capture_output=True)
    return time.perf_counter() - began


def results(store: Path) -> list[tuple[object, ...]]:
    """All that is stored of a sweep but the seconds, as text to the last digit."""
    with open_to_read(store) as reader:
        return [
            (r.design, r.cycle, r.strategy, r.nox_weight, r.ending, json.dumps(r.row, sort_keys=True))
            for r in reader.records()
        ]  # fmt: skip


def best(store: Path) -> dict[float, tuple[float, int]]:
    """NOx weight -> least objective and its design."""
    found: dict[float, tuple[float, int]] = {}
    with open_to_read(store) as reader:
        for record in reader.records():
            value = record.row and record.row["objective_l_per_100km"]
            if value is not None:
                now = found.get(record.nox_weight, (float("inf"), -1))
                found[record.nox_weight] = min(now, (value, record.design))
    return found


def backends(folder: Path) -> list[str]:
    """A thousand designs by ecms and dp on every backend."""
    path = study(folder, "full", strategies='["ecms", "dp"]', cells=10, powers=10, weights=TENS)
    sweep(path, folder / "warm.sqlite", "--jobs", "1", "--dry-run")
    lines = [
        "## 1000 designs (cells x power x NOx weight), ecms and dp",
        "",
        "| run | s | designs/s | speed-up |",
        "|---|---|---|---|",
    ]
    one_s, same = 0.0, []
    for n, (name, *options) in enumerate(RUNS):
        store = folder / f"{n}.sqlite"
        took_s = sweep(path, store, *options)
        one_s = one_s or took_s
        same.append(results(store) == results(folder / "0.sqlite"))
        lines.append(f"| {name} | {took_s:.1f} | {1000 / took_s:.1f} | {one_s / took_s:.2f} |")
        print(lines[-1], flush=True)
    assert all(same), "results differ between backends"
    return [*lines, "", "Results of all four are the same to the last bit.", ""]


def bounds(folder: Path) -> list[str]:
    """Ten thousand designs by their certified dual alone, with weights that share a car's table and without."""
    lines = [
        "## 10 000 designs, certified bound alone, two workers",
        "",
        "| designs | s | designs/s |",
        "|---|---|---|",
    ]
    for name, cells, powers, weights in (
        ("1000 cars with ten NOx weights each", 40, 25, TENS),
        ("one weight, a car for each", 91, 110, [0]),
    ):
        path = study(
            folder,
            f"bounds{cells}",
            strategies='["bound"]',
            cells=cells,
            powers=powers,
            weights=weights,
        )
        took_s = sweep(path, path.with_suffix(".sqlite"), "--jobs", "2")
        count = cells * powers * len(weights)
        lines.append(f"| {name} ({count}) | {took_s:.1f} | {count / took_s:.0f} |")
        print(lines[-1], flush=True)
    return [*lines, ""]


def pruning(folder: Path) -> list[str]:
    """The thousand designs once more, those proven worse left unsolved."""
    path, store = folder / "full.toml", folder / "pruned.sqlite"
    took_s = sweep(path, store, "--jobs", "2", "--prune")
    with open_to_read(store) as reader:
        count = len(reader.pruned())
    full, pruned = best(folder / "1.sqlite"), best(store)
    assert full == pruned, f"pruning lost the optimum: {full} {pruned}"
    return [
        "## The same 1000 designs with --prune",
        "",
        f"{took_s:.1f} s with two workers; {count} designs discarded unsolved. The best design of each of the ten "
        "weights is that of the full sweep, with the same objective to the last bit.",
        "",
    ]  # fmt: skip


def main() -> None:
    """Run everything and write the page."""
    with tempfile.TemporaryDirectory(prefix="hevopt-") as name:
        folder = Path(name)
        sections = [*backends(folder), *bounds(folder), *pruning(folder)]
    on = ", ".join(f"{key} {value}" for key, value in versions().items())
    page = [
        "# Speed of sweeps",
        "",
        "Made by `python tests/benchmarks/sweeps.py`; C2 on the NEDC, from the command to the last stored row.",
        f"{platform.machine()}, {os.cpu_count()} cores; {on}.",
        "",
        *sections,
    ]
    OUT.write_text("\n".join(page))
    print("\n".join(page))


if __name__ == "__main__":
    main()
