"""Saved results with one value changed: the page, or one message, and never a traceback."""

import json
import random
from copy import deepcopy

import pytest
from page_helpers import effect, front

from hevopt.errors import DataError
from hevopt.pages.comparison.page import comparison_page
from hevopt.pages.comparison.saved import load_results

STEPS = 12
OTHERS = (None, "text", -1, 0, 0.5, 1e300, [], {}, True)


def small(nedc):
    """Two rows of a few steps, with a front and a sensitivity."""
    contents = json.loads(nedc.results.model_dump_json())
    contents["rows"] = [contents["rows"][n] for n in (0, 9)]
    contents["cars"] = {name: contents["cars"][name] for name in ("A", "C2")}
    for car in contents["cars"].values():
        for name in ("time_s", "step_s", "speed_mps", "wheel_power_w", "missing_torque_nm"):
            car[name] = car[name][:STEPS]
    for row in contents["rows"]:
        trace = row["detail"]["trace"]
        for name in trace:
            trace[name] = trace[name][: STEPS + (name == "soc")]
    return contents | {"pareto": [front("C2")], "sensitivity": [effect("C2", 3.0)]}


def places_of(value, path=()):
    """The paths of all values, of lists of numbers the first two entries only."""
    inner = (
        value.items()
        if isinstance(value, dict)
        else enumerate(value[:2])
        if isinstance(value, list)
        else ()
    )
    for key, below in inner:
        yield (*path, key)
        yield from places_of(below, (*path, key))


def mutated(contents, path, change):
    changed = deepcopy(contents)
    holder = changed
    for key in path[:-1]:
        holder = holder[key]
    if change == "shorter":
        holder[path[-1]] = holder[path[-1]][:-1]
    else:
        holder[path[-1]] = change
    return changed


def outcome(contents, path):
    """Whether a page is made; False where the one message names the file."""
    path.write_text(json.dumps(contents))
    try:
        results = load_results(path)
    except DataError as error:
        assert str(path) in str(error) and "hevopt compare --save" in str(error)
        return False
    return comparison_page(results).startswith("<!doctype html>")


def test_whatever_one_value_is_changed_to_there_is_a_page_or_one_message(nedc, tmp_path):
    contents, chance = small(nedc), random.Random(20)
    places = list(places_of(contents))
    path, made = tmp_path / "r.json", []
    assert outcome(contents, path)
    for place in chance.sample(places, 120):
        value = contents
        for key in place:
            value = value[key]
        changes = [*OTHERS, "shorter"] if isinstance(value, list) and value else OTHERS
        made.append(outcome(mutated(contents, place, chance.choice(changes)), path))
    assert True in made and False in made


@pytest.mark.parametrize(
    "place",
    [
        ("rows", 1, "figures", "co2_g_per_km"),
        ("rows", 1, "figures", "soc_start"),
        ("rows", 1, "figures", "fuel_corrected_l_per_100km"),
        ("cars", "C2", "missing_torque_nm"),
        ("cars", "C2", "step_s"),
        ("cars", "C2", "engine", "limit_nm"),
        ("sensitivity", 0, "delta_percent"),
    ],
)
def test_what_a_solved_row_must_have_is_missed_by_name(nedc, tmp_path, place):
    change = "shorter" if isinstance(place[-1], str) and place[0] != "rows" else None
    path = tmp_path / "r.json"
    path.write_text(json.dumps(mutated(small(nedc), place, change)))
    with pytest.raises(DataError, match=rf"{place[0]}\.{place[1]}"):
        load_results(path)
