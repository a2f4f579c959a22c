"""What most who hold it never ask for, worked out where it is asked for first."""

from collections.abc import Callable, Iterator, Mapping

from hevopt.problem.arrays import Array


class Late(Mapping[str, Array]):
    """name -> array, of a function that is called at most once.

    Copies and pickles are plain dictionaries.
    """

    __slots__ = ("_found", "_work")

    def __init__(self, work: Callable[[], Mapping[str, Array]]) -> None:
        self._work: Callable[[], Mapping[str, Array]] | None = work
        self._found: Mapping[str, Array] = {}

    def _all(self) -> Mapping[str, Array]:
        if self._work is not None:
            self._found, self._work = self._work(), None
        return self._found

    def __getitem__(self, name: str) -> Array:
        return self._all()[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._all())

    def __len__(self) -> int:
        return len(self._all())

    def __repr__(self) -> str:
        return repr(dict(self))

    def __reduce__(self) -> tuple[type[dict[str, Array]], tuple[dict[str, Array]]]:
        return dict, (dict(self),)
