"""The search for the best design: every one of a small lattice, else trials that Optuna proposes.

Optuna's tree-structured Parzen estimator (J. Bergstra et al., NeurIPS 2011) is asked for a batch at a time, its
answers told in order: the same seed asks for the same designs, whatever runs them and however often it was stopped.
"""

from collections.abc import Callable, Iterator, Sequence
from itertools import product
from math import prod
from typing import TYPE_CHECKING, Any

from hevopt.errors import DataError
from hevopt.sizing.candidates import Candidate, Candidates, Fate
from hevopt.sizing.study_file import SizeStudy
from hevopt.sweeps.plan.parameters import Range, Scalar, Values

if TYPE_CHECKING:
    from optuna.distributions import BaseDistribution
    from optuna.trial import FrozenTrial, Trial

_BATCH = 8
_RANDOM_SHARE, _RANDOM_MIN = 0.25, 8
# Designs asked for again are not counted as trials, but for so many batches in a row.
_STALE_MAX = 20
_DIGITS = 5
# What a design without a value of its own counts, far above any.
_WORST = 1e12


def levels_of(values: Values) -> tuple[Scalar, ...] | None:
    """The values of a parameter in order; None where any number of a range is one."""
    if not isinstance(values, Range):
        return values
    if values.count is None:
        return None
    return tuple(dict.fromkeys(values.at(n, values.count - 1) for n in range(values.count)))


def is_lattice(study: SizeStudy) -> bool:
    """Whether every design can be tried within the trials allowed."""
    levels = [levels_of(values) for values in study.sweep.parameters.values()]
    sizes = [len(of) for of in levels if of is not None]
    return len(sizes) == len(levels) and prod(sizes) <= study.trials


def check_search(study: SizeStudy) -> None:
    """DataError, before a store is made, where designs must be proposed and nobody is there to do so."""
    if not is_lattice(study):
        try:
            import optuna  # noqa: F401
        except ImportError:
            raise DataError(
                "parameters: not a lattice of at most `trials` designs, so that Optuna proposes them, which is not "
                'installed; run: pip install "hevopt[sizing]", or list values and raise trials'
            ) from None


def search(study: SizeStudy, candidates: Candidates, done: Callable[[int], None]) -> None:
    """Judge designs until all of a lattice, or as many as trials, are; done: called with how many there are."""
    if is_lattice(study):
        keys = list(study.sweep.parameters)
        levels = [levels_of(values) or () for values in study.sweep.parameters.values()]
        candidates.judged([dict(zip(keys, point, strict=True)) for point in product(*levels)])
        done(len(candidates.found))
        return
    stale = 0
    for batch in _proposed(study):
        before = len(candidates.found)
        batch.tell(candidates.judged(batch.values))
        done(len(candidates.found))
        stale = 0 if len(candidates.found) > before else stale + 1
        if len(candidates.found) >= study.trials or stale >= _STALE_MAX:
            return


class _Batch:
    """Designs proposed together."""

    def __init__(self, study: SizeStudy, optuna: Any, trials: "Sequence[Trial]") -> None:
        self._study, self._optuna, self._trials = study, optuna, trials
        self.values = [_values(study, trial.params) for trial in trials]

    def tell(self, judged: Sequence[Candidate]) -> None:
        for trial, one in zip(self._trials, judged, strict=True):
            trial.set_user_attr("excess", one.excess)
            known = one.values or one.bounds if one.fate in (Fate.SOLVED, Fate.DISCARDED) else None
            self._optuna.tell(trial, list(known or [_WORST] * len(self._study.objectives)))


def _proposed(study: SizeStudy) -> Iterator[_Batch]:
    import warnings

    import optuna

    optuna.logging.set_verbosity(optuna.logging.ERROR)
    with warnings.catch_warnings():
        # Several parameters at once, and constraints, are told to be experimental.
        warnings.simplefilter("ignore")
        sampler = optuna.samplers.TPESampler(
            seed=study.seed,
            n_startup_trials=max(_RANDOM_MIN, round(_RANDOM_SHARE * study.trials)),
            multivariate=True,
            constant_liar=True,
            constraints_func=_excess,
        )
        made = optuna.create_study(sampler=sampler, directions=["minimize"] * len(study.objectives))
    space = {key: _distribution(values) for key, values in study.sweep.parameters.items()}
    while True:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            batch = _Batch(study, made, [made.ask(space) for _ in range(_BATCH)])
        yield batch


def _excess(trial: "FrozenTrial") -> tuple[float]:
    return (float(trial.user_attrs["excess"]),)


def _distribution(values: Values) -> "BaseDistribution":
    from optuna.distributions import (
        CategoricalDistribution,
        FloatDistribution,
        IntDistribution,
    )

    levels = levels_of(values)
    if levels is not None and isinstance(levels[0], str | bool):
        return CategoricalDistribution(list(range(len(levels))))
    if levels is not None:
        return IntDistribution(0, len(levels) - 1)
    assert isinstance(values, Range)  # only a range has no levels
    if values.whole:
        return IntDistribution(int(values.low), int(values.high), log=values.log)
    return FloatDistribution(float(values.low), float(values.high), log=values.log)


def _values(study: SizeStudy, params: dict[str, Any]) -> dict[str, Scalar]:
    found: dict[str, Scalar] = {}
    for key, values in study.sweep.parameters.items():
        levels = levels_of(values)
        if levels is not None:
            found[key] = levels[params[key]]
        elif isinstance(values, Range):
            found[key] = rounded(values, params[key])
    return found


def rounded(values: Range, number: float) -> int | float:
    """A number of a range in as many digits as designs have, within its ends."""
    if values.whole:
        return int(min(max(number, values.low), values.high))
    return min(max(float(f"{number:.{_DIGITS}g}"), float(values.low)), float(values.high))
