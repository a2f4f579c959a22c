"""hevopt: how little a hybrid could burn on a cycle, how close a strategy comes, and the proof.

Names are loaded on first use, so that `hevopt --help` does not wait for compiled parts.
"""

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

_HOME = {
    "load_architecture": "hevopt.architecture",
    "load_cycle": "hevopt.cycle",
    "build_problem": "hevopt.powertrain",
    "Problem": "hevopt.problem",
    "ControlTable": "hevopt.problem",
    "Control": "hevopt.problem",
    "Plan": "hevopt.problem",
    "Trajectory": "hevopt.problem",
    "Battery": "hevopt.battery",
    "STRATEGIES": "hevopt.strategies",
    "solve": "hevopt.study",
    "simulate": "hevopt.simulation",
    "certify": "hevopt.certificate",
    "Certificate": "hevopt.certificate",
    "compare": "hevopt.study",
    "HevoptError": "hevopt.errors",
    "DataError": "hevopt.errors",
    "InfeasibleError": "hevopt.errors",
    "SolverError": "hevopt.errors",
}

__all__ = ["__version__", *_HOME]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'hevopt' has no attribute {name!r}")
    module = import_module(_HOME[name])
    for exported, home in _HOME.items():
        if home == module.__name__:
            globals()[exported] = getattr(module, exported)
    return globals()[name]


def __dir__() -> list[str]:
    return sorted(__all__)
