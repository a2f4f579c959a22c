"""Carried out of hevopt/imports/figures.py."""

from io import BytesIO
from typing import TYPE_CHECKING

from matplotlib import rc_context
from matplotlib.figure import Figure

if TYPE_CHECKING:
    pass


_DPI = 110


def _vectors(figure: Figure, kind: str) -> bytes:
    """An SVG or PDF, without its date and with names of parts that do not depend on chance."""
    out = BytesIO()
    with rc_context({"svg.hashsalt": "hevopt"}):
        date = {"svg": "Date", "pdf": "CreationDate"}[kind]
        figure.savefig(out, format=kind, metadata={date: None})
    return out.getvalue()


def _png(figure: Figure) -> bytes:
    out = BytesIO()
    figure.savefig(out, format="png", dpi=_DPI, metadata={"Software": None})
    return out.getvalue()
