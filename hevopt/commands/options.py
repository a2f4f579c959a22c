"""Options that several commands take, with one help text each."""

from typing import Annotated

import typer

CycleOption = Annotated[str, typer.Option("--cycle", help="Name or CSV file of a cycle.")]
NoxOption = Annotated[
    float,
    typer.Option("--nox-weight", help="kg of fuel that a kg of NOx counts (ecms, dp, bound)."),
]
ShortfallOption = Annotated[
    bool,
    typer.Option(
        "--allow-shortfall", help="Drive on where the car cannot follow, and mark the rows."
    ),
]
GearOption = Annotated[
    bool, typer.Option("--free-gear", help="The engine's gear is a control, not the cycle's.")
]
RefineOption = Annotated[
    bool,
    typer.Option("--refine", help="Add torque levels around dp's plan until its cost settles."),
]
HorizonOption = Annotated[
    float | None,
    typer.Option("--horizon", help="Preview of the predictive strategies, s (default 20)."),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON object instead.")]
ArchitectureArgument = Annotated[str, typer.Argument(help="Name or TOML file of an architecture.")]
