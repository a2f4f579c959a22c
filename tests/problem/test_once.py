"""What is computed once for a thing is shared by all who ask, and goes with it."""

import gc
from weakref import ref

from problems import random_problem

from hevopt.bounds.prices import one_price_dual
from hevopt.problem.choices import choices_of


def test_all_who_ask_share_what_was_computed_for_a_problem_and_no_other():
    problem, other = random_problem(1), random_problem(1)
    for function in (choices_of, one_price_dual):
        assert function(problem) is function(problem)
        assert function(problem) is not function(other)
    assert problem.battery.arrays is problem.battery.arrays
    assert not problem.battery.arrays.energy_j.flags.writeable


def test_what_was_computed_goes_with_the_problem():
    problem = random_problem(1)
    kept = ref(choices_of(problem).first)
    assert kept() is not None
    del problem
    gc.collect()
    assert kept() is None
