"""Pruning: the optimum stays what it is, and everything discarded is provably worse."""

from math import inf, nan, nextafter

from hypothesis import given, settings
from hypothesis import strategies as st

from hevopt.sweeps.plan.prune import (
    Bounded,
    Pruned,
    Wave,
    follows,
    mean_bound,
    mean_objective,
    search,
)


def run(designs, objectives, wave):
    """All waves of a search whose designs have these objectives."""
    steps, waves = search(designs, (wave,)), []
    try:
        waves.append(next(steps))
        while True:
            waves.append(steps.send({n: objectives[n] for n in waves[-1].designs}))
    except StopIteration:
        return waves


def test_a_search_by_hand():
    bounds = {0: 5.0, 1: 3.0, 2: 4.0, 3: 4.5, 4: 4.4, 5: 6.0}
    designs = [Bounded(n, 0.0, bound) for n, bound in bounds.items()]
    objectives = {0: 9.0, 1: 5.5, 2: 4.5, 3: 4.5, 4: 7.0, 5: 6.5}
    assert run(designs, objectives, 2) == [
        Wave((1, 2), ()),
        Wave((4, 3), (Pruned(0, 5.0, 2, 4.5), Pruned(5, 6.0, 2, 4.5))),
    ]


def test_a_bound_equal_to_the_incumbent_is_kept_and_the_next_float_above_is_not():
    designs = [Bounded(0, 0.0, 1.0), Bounded(1, 0.0, 2.0), Bounded(2, 0.0, nextafter(2.0, 3.0))]
    waves = run(designs, {0: 2.0, 1: 2.0}, 1)
    assert [wave.designs for wave in waves] == [(0,), (1,)]
    assert waves[1].pruned == (Pruned(2, nextafter(2.0, 3.0), 0, 2.0),)


def test_each_nox_weight_has_an_incumbent_of_its_own():
    designs = [
        Bounded(0, 0.0, 1.0),
        Bounded(1, 0.0, 3.0),
        Bounded(2, 10.0, 4.0),
        Bounded(3, 10.0, 5.0),
    ]
    waves = run(designs, {0: 2.0, 2: 6.0, 3: 7.0}, 1)
    assert waves == [Wave((0, 2), ()), Wave((3,), (Pruned(1, 3.0, 0, 2.0),))]


def test_what_is_left_when_all_is_condemned_is_told_in_a_last_wave_without_designs():
    waves = run([Bounded(0, 0.0, 1.0), Bounded(1, 0.0, 3.0)], {0: 2.0}, 1)
    assert waves == [Wave((0,), ()), Wave((), (Pruned(1, 3.0, 0, 2.0),))]
    assert run([], {}, 4) == []


def test_failed_designs_condemn_nothing_and_failed_bounds_are_solved():
    designs = [
        Bounded(0, 0.0, 1.0),
        Bounded(1, 0.0, None),
        Bounded(2, 0.0, nan),
        Bounded(3, 0.0, 9.0),
    ]
    waves = run(designs, {0: None, 1: nan, 2: None, 3: 9.5}, 1)
    assert [wave.designs for wave in waves] == [(1,), (2,), (0,), (3,)]
    assert not any(wave.pruned for wave in waves)
    after_a_good_one = run([Bounded(0, 0.0, inf), Bounded(1, 0.0, 1.0)], {0: 5.0, 1: 1.0}, 1)
    assert [wave.designs for wave in after_a_good_one] == [(0,), (1,)]


def test_waves_begin_small_and_grow_for_each_weight():
    designs = [Bounded(n, n % 2, 1.0) for n in range(240)]
    steps = search(designs)
    sizes = [len(next(steps).designs)]
    while sum(sizes) < 240:
        sizes.append(len(steps.send(dict.fromkeys(range(240), 2.0)).designs))
    assert sizes == [8, 16, 32, 64, 64, 56]


def test_a_design_follows_its_cycles_where_no_row_has_a_shortfall():
    good, short = {"status": "not neutral"}, {"status": "not neutral, shortfall at 9 steps"}
    assert follows([good, None, {}]) and not follows([good, short])


def test_means_are_over_cycles_of_the_best_strategy():
    assert mean_bound([3.0, 5.0]) == 4.0 and mean_bound([0.1] * 10) == 0.1
    assert mean_bound([3.0, None]) is None and mean_bound([]) is None
    assert mean_objective([[4.0, 3.0], [None, 5.0]]) == 4.0
    assert mean_objective([[4.0], [None, None]]) is None
    assert mean_objective([[4.0], []]) is None and mean_objective([[nan], [1.0]]) is None


positive = st.floats(0.1, 10.0)


@settings(max_examples=200, deadline=None, derandomize=True)
@given(
    st.lists(st.tuples(positive, st.sampled_from([0.0, 1e-16, 1e-3, 1.0])), min_size=1, max_size=9)
)
def test_the_mean_of_bounds_is_nowhere_above_that_of_objectives(cycles):
    bounds = [bound for bound, _ in cycles]
    objectives = [[bound + more, 11.0] for bound, more in cycles]
    assert mean_bound(bounds) <= mean_objective(objectives)


# Few distinct figures, so that many designs and bounds are equal.
figures = st.one_of(st.sampled_from([1.0, 2.0, 3.0]), positive)
cases = st.lists(
    st.tuples(
        st.sampled_from([0.0, 5.0]),  # NOx weight
        figures,  # objective
        st.one_of(st.sampled_from([0.0, 0.5]), st.floats(0, 5)),  # how far below it the bound is
        st.sampled_from(["good", "good", "good", "no bound", "fails", "neither"]),
    ),
    max_size=40,
)


@settings(max_examples=300, deadline=None, derandomize=True)
@given(cases, st.integers(1, 7), st.randoms(use_true_random=False))
def test_pruning_keeps_the_optimum_and_discards_only_what_is_provably_worse(cases, wave, random):
    designs, objectives = [], {}
    for n, (weight, objective, below, fate) in enumerate(cases):
        bound = None if fate in ("no bound", "neither") else objective - below
        designs.append(Bounded(n, weight, bound))
        objectives[n] = {"fails": None, "neither": nan}.get(fate, objective)
    good = {
        n: objective
        for n, objective in objectives.items()
        if objective is not None and objective > 0
    }
    waves = run(designs, objectives, wave)
    solved = [n for step in waves for n in step.designs]
    pruned = [gone for step in waves for gone in step.pruned]
    assert sorted(solved + [gone.design for gone in pruned]) == list(range(len(cases)))
    for weight in (0.0, 5.0):
        of_weight = [n for n, case in enumerate(cases) if case[0] == weight]
        best = min(((good[n], n) for n in of_weight if n in good), default=None)
        found = [(good[n], n) for n in of_weight if n in solved and n in good]
        assert min(found, default=None) == best
    best_known: dict[float, tuple[float, int]] = {}
    for step in waves:
        for gone in step.pruned:
            incumbent = best_known[designs[gone.design].nox_weight]
            assert (gone.objective, gone.incumbent) == incumbent
            assert designs[gone.design].bound == gone.bound > gone.objective
            assert good.get(gone.design, inf) > gone.objective
        for n in step.designs:
            incumbent = best_known.get(designs[n].nox_weight, (inf, n))
            assert designs[n].bound is None or designs[n].bound <= incumbent[0]
        for n in filter(good.__contains__, step.designs):
            weight = designs[n].nox_weight
            best_known[weight] = min(best_known.get(weight, (inf, n)), (good[n], n))
    random.shuffle(designs)
    assert run(designs, objectives, wave) == waves
