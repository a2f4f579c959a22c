"""Where hevopt is installed read-only and the home cannot be written either, it compiles without a cache."""

from numba.core.dispatcher import Dispatcher

from hevopt._compile import compiled


def test_without_a_place_for_the_cache_a_loop_is_compiled_all_the_same(monkeypatch):
    def enable_caching(self):
        raise RuntimeError("cannot cache function 'twice': no locator available for file 'x.py'")

    monkeypatch.setattr(Dispatcher, "enable_caching", enable_caching)

    @compiled()
    def twice(x):
        return 2 * x

    assert twice(21) == 42
