"""Where tasks go: processes of this machine (loky), a Dask or a Ray cluster, of its own or one that runs already.

A pool takes a function of no arguments and gives a future. Dask and Ray are imported where they are asked for.
"""

import logging
import os
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hevopt.errors import DataError
from hevopt.files.shown import first_line, shown
from hevopt.sweeps.workers.supervisor import ONE_THREAD, end_with, python_path

BACKENDS = ("loky", "dask", "ray")
MODULES = {"dask": "distributed", "ray": "ray"}
_CONNECT_S = 20.0


@dataclass(frozen=True, slots=True, eq=False)
class Pool:
    """send: puts a call on its way; workers: how many run at a time; window: how many to have on their way."""

    send: Callable[[Callable[[], Any]], Future[Any]]
    workers: int
    window: int
    close: Callable[[], None]


def open_pool(backend: str, workers: int | None, scheduler: str | None) -> Pool:
    """A pool of some workers: by default as many as this process may use cores, or all of the scheduler's.

    Raises DataError where the backend is not installed, or nothing answers at the scheduler's address in time.
    """
    if scheduler is not None:
        _check_answer(backend, scheduler)
    return OPENED[backend](workers, scheduler)


def check_backend(backend: str, scheduler: str | None) -> None:
    """DataError, before anything is planned, where a backend is unknown or not installed."""
    if backend not in BACKENDS:
        raise DataError(f"backend {shown(backend)}; allowed: {', '.join(BACKENDS)}")
    if backend == "loky" and scheduler is not None:
        raise DataError(
            "--scheduler: loky runs on this machine alone; choose --backend dask or ray"
        )
    try:
        if backend == "dask":
            import distributed  # noqa: F401
        elif backend == "ray":
            if scheduler is not None:
                _show_token()
            import ray  # noqa: F401
    except ImportError:
        raise DataError(
            f'backend {backend} is not installed; run: pip install "hevopt[{backend}]"'
        ) from None


def _show_token() -> None:
    """Have Ray, once it is loaded, show the user's token, if there is one, to a cluster that asks for it.

    It does so by itself for a cluster that it finds or starts, not for one named by its address.
    """
    path = os.environ.get("RAY_AUTH_TOKEN_PATH", Path.home() / ".ray" / "auth_token")
    if "RAY_AUTH_TOKEN" in os.environ or Path(path).is_file():
        os.environ.setdefault("RAY_AUTH_MODE", "token")


def _check_answer(backend: str, scheduler: str) -> None:
    """DataError where a scheduler does not answer: asked by a process that is ended, since to a silent one, or a
    wrong address, Dask and Ray hold on for minutes or for ever, and tell stderr of it."""
    command = [sys.executable, "-P", "-m", "hevopt.sweeps.workers.probe"]
    asked = subprocess.run(
        [*command, backend, scheduler, str(_CONNECT_S), str(os.getpid())], stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, errors="replace",
        env=os.environ | {"PYTHONPATH": python_path()},
    )  # fmt: skip
    if asked.returncode:
        silent = no_answer(backend, scheduler, "its client ended without one")
        raise DataError((asked.stdout.splitlines() or [silent])[-1])


def cores() -> int:
    """How many cores this process may use."""
    from loky import cpu_count

    return int(cpu_count())


def _loky(workers: int | None, _: str | None) -> Pool:
    from loky import ProcessPoolExecutor

    count = workers or cores()
    executor = ProcessPoolExecutor(
        count, env=ONE_THREAD, initializer=end_with, initargs=(os.getpid(),)
    )
    # Workers hold nothing but a process that solves; ended at once, they take it along.
    return Pool(executor.submit, count, 2 * count, lambda: executor.shutdown(kill_workers=True))


def _dask(workers: int | None, scheduler: str | None) -> Pool:
    from distributed import Client, LocalCluster

    cluster = client = None
    try:
        if scheduler is None:
            cluster = LocalCluster(
                n_workers=workers or cores(), threads_per_worker=1, processes=True, memory_limit=0,
                dashboard_address="127.0.0.1:0", silence_logs=logging.CRITICAL,
            )  # fmt: skip
        client = Client(cluster or scheduler, timeout=_CONNECT_S, set_as_default=False)
        client.wait_for_workers(1, timeout=_CONNECT_S)
    except Exception as error:
        for opened in filter(None, (client, cluster)):
            opened.close()
        raise DataError(no_answer("dask", scheduler, first_line(error))) from None

    count = sum(client.nthreads().values())
    limited = min(workers or count, count)
    kept: dict[Future[Any], Any] = {}

    def send(call: Callable[[], Any]) -> Future[Any]:
        done: Future[Any] = Future()
        # Its arguments travel with the task, so that no worker's end loses them. A future let go is cancelled.
        kept[done] = future = client.submit(call, pure=False)
        future.add_done_callback(lambda found: settle(done, found))
        return done

    def settle(done: Future[Any], found: Any) -> None:
        try:
            done.set_result(found.result())
        except BaseException as error:
            done.set_exception(error)
        kept.pop(done, None)

    def close() -> None:
        with suppress(Exception):
            client.cancel(list(kept.values()), force=True)
        kept.clear()
        client.close()
        if cluster is not None:
            cluster.close()

    return Pool(send, limited, limited if workers and scheduler else 2 * limited, close)


def _ray(workers: int | None, scheduler: str | None) -> Pool:
    import ray

    where: dict[str, Any] = {}
    if scheduler is None:
        where = {"num_cpus": workers or cores(), "include_dashboard": False}
        # Where memory runs out, the system ends the process of a case; Ray would end its worker, time after time.
        os.environ.setdefault("RAY_memory_monitor_refresh_ms", "0")
        # Ray's workers give way to everything else on the machine unless told otherwise.
        os.environ.setdefault("RAY_worker_niceness", "0")
    try:
        ray.init(
            address=scheduler or "local", log_to_driver=False, logging_level=logging.CRITICAL, **where
        )  # fmt: skip
        count = int(ray.cluster_resources().get("CPU", 0))
    except Exception as error:
        raise DataError(no_answer("ray", scheduler, first_line(error))) from None
    if not count:
        ray.shutdown()
        raise DataError(no_answer("ray", scheduler, "the cluster has no CPU"))
    run = ray.remote(num_cpus=1, max_retries=3)(_called)
    limited = min(workers or count, count)

    def send(call: Callable[[], Any]) -> Future[Any]:
        future: Future[Any] = run.remote(call).future()
        return future

    return Pool(send, limited, limited if workers and scheduler else 2 * limited, ray.shutdown)


def _called(call: Callable[[], Any]) -> Any:
    return call()


OPENED = {"loky": _loky, "dask": _dask, "ray": _ray}


def no_answer(backend: str, scheduler: str | None, why: str) -> str:
    """The message where a cluster cannot be had."""
    where = f"at {shown(scheduler)}" if scheduler else "on this machine"
    return (
        f"no {backend.title()} cluster {where} ({why}); check that it runs and has workers, and that its version "
        "is that of this environment"
    )
