"""hevopt: how little a hybrid could burn on a cycle, how close a strategy comes, and the proof.

Names are loaded on first use, so that `hevopt --help` does not wait for compiled parts.
"""

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

_HOME = {
    "load_architecture": "hevopt.car_files.load",
    "load_cycle": "hevopt.driving.cycle",
    "build_problem": "hevopt.powertrain.powertrain",
    "Problem": "hevopt.problem.problem",
    "ControlTable": "hevopt.problem.table",
    "Control": "hevopt.problem.table",
    "Plan": "hevopt.problem.problem",
    "Trajectory": "hevopt.problem.problem",
    "Battery": "hevopt.problem.battery",
    "sensitivities": "hevopt.studies.sensitivity",
    "pareto": "hevopt.studies.fronts",
    "STRATEGIES": "hevopt.strategies",
    "Strategy": "hevopt.strategies",
    "register": "hevopt.strategies",
    "stepwise": "hevopt.strategies.stepwise",
    "policy": "hevopt.strategies.policy",
    "Step": "hevopt.strategies.stepwise",
    "Stepper": "hevopt.strategies.stepper",
    "Signals": "hevopt.problem.table",
    "solve": "hevopt.studies.comparison",
    "simulate": "hevopt.problem.simulation",
    "certify": "hevopt.bounds.certificate",
    "Certificate": "hevopt.bounds.certificate",
    "write_proof": "hevopt.output.proof_files",
    "compare": "hevopt.studies.comparison",
    "Comparison": "hevopt.studies.comparison",
    "compare_and_report": "hevopt.pages.comparison.compared",
    "report": "hevopt.pages.report",
    "read_saved": "hevopt.pages.comparison.frames",
    "read_saved_steps": "hevopt.pages.comparison.frames",
    "sweep": "hevopt.sweeps.sweep",
    "read_sweep": "hevopt.sweeps.store.frames",
    "size": "hevopt.sizing.size",
    "import_cycle": "hevopt.measured.cycles.cycle",
    "import_drives": "hevopt.measured.cycles.cycle",
    "import_map": "hevopt.measured.maps.component",
    "tip_in_study": "hevopt.tipin.study",
    "settled_full_load": "hevopt.tipin.study",
    "drive": "hevopt.studies.driven",
    "DrivenPlan": "hevopt.studies.driven",
    "performance": "hevopt.forward.performance",
    "Performance": "hevopt.forward.performance",
    "Handling": "hevopt.car.handling",
    "Asking": "hevopt.forward.asked",
    "coastdown": "hevopt.measured.coastdown.coastdown",
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
