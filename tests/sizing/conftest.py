"""A short cycle with gears for all tests of proofs."""

import pytest

from hevopt.driving.cycle import load_cycle

END = 196


@pytest.fixture(scope="session")
def urban_file(tmp_path_factory):
    """The first urban part of the NEDC, its gears listed."""
    lines = load_cycle("nedc")
    path = tmp_path_factory.mktemp("cycle") / "urban.csv"
    rows = ["time_s,speed_kmh,gear,clutch_open"]
    for k in range(END):
        rows.append(
            f"{lines.time_s[k]:g},{3.6 * lines.speed_mps[k]:.9f},{lines.gear[k]},{int(lines.clutch_open[k])}"
        )
    path.write_text("\n".join(rows) + "\n")
    return path


@pytest.fixture(scope="session")
def urban(urban_file):
    return load_cycle(urban_file)
