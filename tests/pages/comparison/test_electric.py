"""Cars without an engine, in the table and on the page: nothing is said of engines, gears and NOx."""

import pytest
from sizing_helpers import CYCLE

from hevopt.bounds.claim import PROOF_WORDS
from hevopt.output.terminal_tables import comparison_notes, comparison_table, left_out
from hevopt.pages.comparison.collect import Collector
from hevopt.pages.comparison.page import comparison_page
from hevopt.studies.comparison import compare

CARS = ("A", "electric_compact")


@pytest.fixture(scope="module")
def short(tmp_path_factory):
    path = tmp_path_factory.mktemp("cycle") / "short.csv"
    path.write_text(CYCLE)
    return path


def made(short, cars):
    collector = Collector()
    found = compare(short, architectures=cars, strategies=["dp"], observe=collector.observe)
    return found, comparison_page(collector.results(found, "hevopt compare"))


def heads(table):
    return {str(column.header).partition("\n")[0] for column in table.columns}


def test_of_cars_without_an_engine_nothing_is_said_of_engines(short):
    found, page = made(short, ["electric_compact"])
    table = comparison_table(found)
    assert "battery" in heads(table) and not heads(table) & {
        "fuel",
        "NOx",
        "starts",
        "CO2",
        "bound",
    }
    assert left_out(found, table) == [] and len(left_out(found, comparison_table(found, 40))) > 0
    notes = comparison_notes(found)
    assert "warm" not in notes and "gears" not in notes and "NOx" not in notes
    row = found.rows[0]
    verdict = page.partition('class="verdict">')[2].partition("</p>")[0]
    assert f"{row.electricity_kwh_per_100km:.2f}\u00a0kWh" in verdict and "fuel" not in verdict
    section = page.partition('id="comparison"')[2].partition("</section>")[0]
    assert (
        "NOx" not in section and "Starts" not in section and "electricity_kwh_per_100km" in section
    )
    assumed = page.partition('class="assumptions"')[2].partition("</aside>")[0]
    assert "warm" not in assumed and "NOx" not in assumed and "Gears" not in assumed
    assert 'href="#change"' not in page and 'id="change"' not in page


def test_beside_a_car_with_an_engine_all_of_it_is_said(short):
    found, page = made(short, list(CARS))
    assert {"fuel", "NOx", "starts"} <= heads(comparison_table(found))
    notes = comparison_notes(found)
    assert "The engine is warm" in notes and "NOx is unknown for" not in notes
    assert (
        "warm from start to end"
        in page.partition('class="assumptions"')[2].partition("</aside>")[0]
    )


def test_a_proof_is_explained_in_the_same_words_below_table_and_page(short):
    found, page = made(short, ["A"])
    proof = found.rows[0].certificate.proof
    words = f"{proof} = {PROOF_WORDS[proof]}"
    assert words in comparison_notes(found) and words in page
    assert f'title="a bound by {PROOF_WORDS[proof]}"' in page
