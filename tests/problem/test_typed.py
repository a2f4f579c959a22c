"""A loop that is called without a look at its arguments' types is the same loop."""

import numpy as np

from hevopt.powertrain._points_kernels import nearest
from hevopt.problem.typed import typed


def test_a_typed_loop_gives_what_the_loop_does():
    rng = np.random.default_rng(2)
    first, second = rng.uniform(size=(2, 50))
    of_types = typed(nearest, first, second, (0.0, 0.0), (1.0, 2.0))
    for at in rng.uniform(size=(20, 2)).tolist():
        asked = first, second, tuple(at), (1.0, 2.0)
        assert of_types(*asked) == nearest(*asked)


def test_what_is_not_compiled_is_left_as_it_is():
    assert typed(max, 1.0, 2.0) is max
