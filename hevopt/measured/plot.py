"""Figures as files: the same bytes from the same figure."""

from io import BytesIO

from matplotlib import rc_context
from matplotlib.figure import Figure

_DPI = 110


def vectors(figure: Figure, kind: str) -> bytes:
    """An SVG or PDF, without its date and with names of parts that do not depend on chance."""
    out = BytesIO()
    with rc_context({"svg.hashsalt": "hevopt"}):
        date = {"svg": "Date", "pdf": "CreationDate"}[kind]
        figure.savefig(out, format=kind, metadata={date: None})
    return out.getvalue()


def png(figure: Figure) -> bytes:
    """A PNG, without the version of what drew it."""
    out = BytesIO()
    figure.savefig(out, format="png", dpi=_DPI, metadata={"Software": None})
    return out.getvalue()
