"""What is small and shared about arrays."""

import numpy as np
import pytest

from hevopt.problem.arrays import rising


@pytest.mark.parametrize(
    "values", [([],), ([2.0],), ([3.0, 1.0, 3.0], [1.0, 2.0]), ([0.0, -0.0], [])]
)
def test_values_come_once_and_rising(values):
    every = [np.array(some, dtype=np.float64) for some in values]
    assert rising(*every).tolist() == np.unique(np.concatenate(every)).tolist()
