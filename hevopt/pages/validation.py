"""The page of the real cars: the Markdown page as one HTML file, its figures drawn."""

import gzip
import json
import re
from collections.abc import Sequence

from markdown_it import MarkdownIt
from markupsafe import Markup

from hevopt.pages.render import render
from hevopt.reproduction.validation.cases import Held, fuel
from hevopt.reproduction.validation.page import worst_first
from hevopt.studies.provenance import versions

_TITLE = "Real cars, held against the laboratory"
_BOX = '<div class="scroll" tabindex="0"><table>'


def validation_page(held: Sequence[Held], text: str) -> str:
    """The page as HTML. text: the same as Markdown, whose title stands in the header"""
    body = MarkdownIt("commonmark", {"html": False}).enable("table").render(text.partition("\n")[2])
    sections = iter(range(1, 100))
    body = re.sub("<h2>", lambda _: f'<h2 id="section-{next(sections)}">', body)
    data = json.dumps(_drawn(held), separators=(",", ":"), allow_nan=False)
    return render(
        "validation.html.j2",
        ("validation.js",),
        gzip.compress(data.encode(), 6, mtime=0),
        title=_TITLE,
        heads=re.findall(r"^## (.+)$", text, re.M),
        # The library escapes every text of the tables; raw HTML is off.
        body=Markup(body.replace("<table>", _BOX).replace("</table>", "</table></div>")),
        height=120 + 34 * len(held),
        versions=versions(),
    )


def _drawn(held: Sequence[Held]) -> list[dict[str, object]]:
    """What the figure shows, worst first; l/100 km."""
    return [
        {
            "name": f"{h.laboratory.car}, {h.laboratory.cycle}",
            "measured": h.laboratory.fuel_l_per_100km,
            "warm": h.laboratory.warm_l_per_100km,
            "bound": h.bound_l_per_100km,
            "rule": fuel(h.rule),
            "causal": fuel(h.causal),
        }
        for h in worst_first(held)
    ]
