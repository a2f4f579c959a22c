"""Ctrl-C, and the signals by which a cluster or a closed terminal ends a run, as a wish that is met in order."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from time import monotonic
from types import FrameType

_ASKED = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_PATIENCE_S = 5.0


class Wish:
    """Whether the run was asked to end. The first asking is only noted while `held`, else a KeyboardInterrupt.

    Asked again it goes on ending in order, unless that takes long.
    """

    def __init__(self) -> None:
        self.asked = self._held = False
        self._since_s = 0.0

    def __call__(self) -> bool:
        return self.asked

    def receive(self, number: int, frame: FrameType | None) -> None:
        first, self.asked = not self.asked, True
        if first:
            self._since_s = monotonic()
        patience_over = monotonic() - self._since_s > _PATIENCE_S
        if patience_over or (first and not self._held):
            raise KeyboardInterrupt

    @contextmanager
    def held(self) -> Iterator[None]:
        """For a part of the run that looks at the wish itself."""
        self._held = True
        try:
            yield
        finally:
            self._held = False


@contextmanager
def wish_to_end() -> Iterator[Wish]:
    """Where signals say that the run is to end, but for those that it was started to ignore, as by `nohup`.

    Outside the main thread, which gets them, they are left alone.
    """
    wish = Wish()
    if threading.current_thread() is not threading.main_thread():
        yield wish
        return
    heard = [number for number in _ASKED if signal.getsignal(number) != signal.SIG_IGN]
    before = {number: signal.signal(number, wish.receive) for number in heard}
    try:
        yield wish
    finally:
        for number, handler in before.items():
            # Once asked the process is about to end; whoever asks again gets what they want.
            signal.signal(number, signal.SIG_IGN if wish.asked else handler)
