"""What the tables in the terminal have in common: their look, the width they need, and how a figure is written."""

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

# More than any table takes.
WIDEST = 400


def titled_table(title: str | None) -> Table:
    """An empty table, its title as it stands: a name such as "[red]" would be markup in a string."""
    return Table(
        box=box.SIMPLE_HEAD,
        title=Text(title, style="table.title") if title else None,
        title_justify="left",
        collapse_padding=True,
        pad_edge=False,
    )


def needed_width(table: Table) -> int:
    """Columns of a terminal that a table takes where nothing in it goes on in the next line."""
    return Console(width=WIDEST).measure(table).maximum


def number(value: float | None, digits: int) -> str:
    """A figure with so many digits behind the point, "-" for none."""
    return "-" if value is None else f"{value:.{digits}f}"
