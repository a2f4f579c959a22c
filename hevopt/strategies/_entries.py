"""Entries of each step by a figure of theirs."""

import numpy as np

from hevopt.problem.arrays import Array, Flags, Indices
from hevopt.problem.choices import Choices


def least_entries(choices: Choices, figure: Array, allowed: Flags) -> Indices:
    """(time,) entry of least figure among the allowed ones, -1 where there is none."""
    masked = np.where(allowed, figure, np.inf)
    least = step_minimum(choices, masked)
    step = choices.spread(np.arange(choices.steps))
    hits = np.flatnonzero((masked == least[step]) & np.isfinite(masked))
    entry = np.full(choices.steps, -1, dtype=np.int64)
    entry[step[hits][::-1]] = hits[::-1]
    return entry


def step_minimum(choices: Choices, figure: Array) -> Array:
    """(time,) least of an (entry,) figure in each step."""
    return np.minimum.reduceat(figure, choices.first[:, 0])
