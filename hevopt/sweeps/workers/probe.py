"""Asks a scheduler that runs already whether it answers, as a process that is ended where it does not.

    python -m hevopt.sweeps.probe BACKEND ADDRESS SECONDS PARENT

Exit status 0 where it has workers, else what is wrong as the last line of its output. It ends with its parent.
"""

import os
import sys
import threading
from importlib import import_module
from typing import NoReturn

from hevopt.errors import DataError
from hevopt.sweeps.workers.pools import MODULES, OPENED, no_answer
from hevopt.sweeps.workers.supervisor import end_with


def main() -> None:
    """Ask, and leave without waiting for what the backend's library has started."""
    backend, scheduler, limit_s, parent = sys.argv[1:]
    end_with(int(parent))
    # Loading takes long on a busy machine, and says nothing of the scheduler.
    import_module(MODULES[backend])
    late = threading.Timer(
        float(limit_s), _leave, [no_answer(backend, scheduler, f"none within {float(limit_s):g} s")]
    )
    late.daemon = True
    late.start()
    try:
        OPENED[backend](None, scheduler).close()
    except DataError as error:
        _leave(str(error))
    _leave(None)


def _leave(fault: str | None) -> NoReturn:
    if fault is not None:
        print(f"\n{fault}", flush=True)
    os._exit(fault is not None)


if __name__ == "__main__":
    main()
