"""What all pages share: one self-contained HTML file that opens offline, from disk or a mail attachment.

Templates escape every text. Data and the drawing library are embedded compressed and unpacked by the browser;
a policy in the page's head allows no address whatever, and no script but those whose digest it lists.
"""

import base64
import gzip
import hashlib
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from hevopt.files.shown import encodable
from hevopt.pages.words import explained

_TEMPLATES = Path(__file__).parent / "templates"


def render(
    template: str, scripts: tuple[str, ...], data: bytes, *, figures: bool = True, **context: Any
) -> str:
    """The page of a template as HTML.

    scripts: files of `templates/` that draw it, in order; data: what they draw, packed with gzip
    figures: whether there are any, for which the page carries the drawing library along
    """
    library, digest = _plotly() if figures else ("", "")
    code = "".join(_own(name) for name in ("page.js", *scripts))
    allowed = " ".join(f"'sha256-{d}'" for d in (digest, _digest(code)) if d)
    page = _environment().get_template(template).render(
        policy=f"default-src 'none'; script-src {allowed}; style-src 'unsafe-inline'; "
        "img-src data: blob:; base-uri 'none'; form-action 'none'",
        style=Markup(_own("page.css")),
        code=Markup(code),
        library=Markup(library),
        data=Markup(base64.b64encode(data).decode()),
        **context,
    )  # fmt: skip
    return encodable(page)


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=FileSystemLoader(_TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["fixed"] = fixed
    environment.filters["weights"] = weights
    environment.filters["explained"] = explained
    return environment


def fixed(value: float | None, form: str = ".3f") -> str:
    """A number with a true minus sign and no negative zero; a dash where there is none."""
    if value is None:
        return "–"
    text = format(value, form)
    if not any(digit in text for digit in "123456789"):
        text = text.replace("-", "+" if "+" in form else "")
    return text.replace("-", "−")


def weights(values: Sequence[float]) -> str:
    """The least and the largest of some weights with three digits, without powers of ten."""
    shown = [
        np.format_float_positional(float(f"{value:.3g}"), trim="-")
        for value in (min(values), max(values))
    ]
    return " to ".join(dict.fromkeys(shown))


@cache
def _plotly() -> tuple[str, str]:
    """The drawing library, packed, and its digest."""
    from plotly.offline import get_plotlyjs

    code = get_plotlyjs()
    packed = gzip.compress(code.encode(), compresslevel=6, mtime=0)
    return base64.b64encode(packed).decode(), _digest(code)


@cache
def _own(name: str) -> str:
    return (_TEMPLATES / name).read_text(encoding="utf-8")


def _digest(code: str) -> str:
    return base64.b64encode(hashlib.sha256(code.encode()).digest()).decode()
