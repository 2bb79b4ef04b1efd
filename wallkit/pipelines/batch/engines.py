"""Pieces of a batch -> their outcomes, by processes of this machine or by a Dask cluster: nothing here schedules."""

from __future__ import annotations

import itertools
import logging
import multiprocessing
import os
import threading
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

import wallkit
from wallkit.batch.rows import Outcome
from wallkit.errors import WallkitError
from wallkit.pipelines.batch.plan import Task
from wallkit.pipelines.batch.work import do_piece, failed, found_done

Piece = tuple[Task, ...]
Engine = Callable[[Iterator[Piece]], Iterator[list[Outcome]]]

# pieces of a cluster that are handed out before they are needed, for each worker: the driver holds no more
_AHEAD = 2
# a run is given up when so many processes have died of it, as Dask does
_DEATHS = 3
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


def local_engine(jobs: int) -> Engine:
    """Processes of this machine, one thread each; one that dies is replaced, and its piece goes to another one."""

    def run(pieces: Iterator[Piece]) -> Iterator[list[Outcome]]:
        for name in _THREADS:
            os.environ.setdefault(name, "1")
        before = set(multiprocessing.active_children())
        # a pool for each process: in one pool a death takes all others with it, and nobody knows whose it was
        pools = [_pool() for _ in range(jobs)]
        try:
            yield from _through_pools(pieces, pools)
        except BaseException:
            # stopped: what they are at is begun again next time, what they have done stays
            for process in set(multiprocessing.active_children()) - before:
                process.terminate()
            raise
        finally:
            for pool in pools:
                pool.shutdown(wait=True, cancel_futures=True)

    return run


def _through_pools(pieces: Iterator[Piece], pools: list[ProcessPoolExecutor]) -> Iterator[list[Outcome]]:
    """Outcomes as they come; a pool whose process died is replaced in `pools`."""
    free, running, again = list(range(len(pools))), dict[Future[list[Outcome]], tuple[int, Piece]](), list[Piece]()
    deaths: Counter[str] = Counter()
    while True:
        while free and (piece := again.pop() if again else next(pieces, None)):
            number = free.pop()
            running[_submitted(pools, number, piece)] = number, piece
        if not running:
            return
        for future in wait(running, return_when=FIRST_COMPLETED).done:
            number, piece = running.pop(future)
            free.insert(0, number)
            try:
                yield future.result()
            except BrokenProcessPool:
                pools[number].shutdown(wait=False)
                pools[number] = _pool()
                suspect = next((task.key for task in piece if found_done(task) is None), "")
                deaths[suspect] += 1
                outcomes, rest = without_killer(piece) if deaths[suspect] == _DEATHS else ([], piece)
                again += [rest] if rest else []
                yield outcomes


def _submitted(pools: list[ProcessPoolExecutor], number: int, piece: Piece) -> Future[list[Outcome]]:
    try:
        return pools[number].submit(do_piece, piece, wallkit.__version__)
    except BrokenProcessPool:
        # it died while it had nothing to do
        pools[number].shutdown(wait=False)
        pools[number] = _pool()
        return pools[number].submit(do_piece, piece, wallkit.__version__)


def without_killer(piece: Piece) -> tuple[list[Outcome], Piece]:
    """What is known of a piece whose process died: the runs before are done, the next one killed it, the rest is left."""
    known = list(itertools.takewhile(lambda pair: pair[1] is not None, ((task, found_done(task)) for task in piece)))
    outcomes = [outcome for _, outcome in known if outcome is not None]
    if len(known) < len(piece):
        message = "the process that ran it ended suddenly, out of memory perhaps"
        outcomes.append(failed(piece[len(known)], message))
    return outcomes, piece[len(known) + 1 :]


def _pool() -> ProcessPoolExecutor:
    # a fresh process: neither OpenGL nor the threads of libraries survive a fork
    return ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn"), initializer=_begin)


def _begin() -> None:
    """Of a worker process: Ctrl-C is the driver's, and so is the end."""
    import signal

    import cv2

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    cv2.setNumThreads(1)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: multiprocessing.process.BaseProcess) -> None:
    parent.join()
    os._exit(1)


def cluster_engine(address: str, folder: Path, say: Callable[[str], None]) -> Engine:
    """The workers of a Dask scheduler.

    Args:
        folder: of the batch, which all workers must see under this very path.
        say: told where the dashboard is.

    Raises:
        WallkitError: dask is not installed, no scheduler answers, or a worker has another wallkit or sees no folder.
    """
    try:
        import distributed
    except ImportError as error:
        hint = "pip install 'wallkit[cluster]'"
        raise WallkitError("a cluster needs dask and distributed", where="--scheduler", hint=hint) from error

    def run(pieces: Iterator[Piece]) -> Iterator[list[Outcome]]:
        # it tells of lost connections with tracebacks; we say it in a sentence
        for name in ("distributed", "distributed.client", "distributed.core", "distributed.comm"):
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)
        try:
            client: Any = distributed.Client(  # type: ignore[no-untyped-call]
                address, timeout="10s", set_as_default=False
            )
        except (OSError, ValueError, ImportError) as error:
            hint = "start one with `dask scheduler`, and workers with `dask worker ADDRESS --nthreads 1`"
            raise WallkitError(f"no scheduler answers: {error}", where=address, hint=hint) from error
        try:
            _check_workers(client, address, folder)
            say(f"dashboard {client.dashboard_link}")
            yield from _through_client(client, pieces, address)
        finally:
            client.close(timeout=2)

    return run


def _through_client(client: Any, pieces: Iterator[Piece], address: str) -> Iterator[list[Outcome]]:
    from concurrent.futures import CancelledError

    import distributed
    from distributed.comm.core import CommClosedError

    running: dict[str, Piece] = {}
    again: list[Piece] = []
    done: Any = distributed.as_completed([], loop=client.loop)  # type: ignore[no-untyped-call]
    while True:
        ahead = _AHEAD * max(1, sum(client.nthreads().values())) if client.status == "running" else 0
        chosen = [*itertools.islice(pieces, max(0, ahead - len(running))), *again]
        again.clear()
        for piece in chosen:
            future = client.submit(do_piece, piece, wallkit.__version__, pure=False)
            running[future.key] = piece
            done.add(future)
        if not running:
            return
        future = next(done)
        piece = running.pop(future.key)
        try:
            yield future.result()
        except distributed.KilledWorker:
            outcomes, rest = without_killer(piece)
            again += [rest] if rest else []
            yield outcomes
        except (CancelledError, CommClosedError, OSError) as error:
            hint = "what is done is kept: start the scheduler, and the same command goes on from here"
            raise WallkitError("the scheduler went away", where=address, hint=hint) from error


def _check_workers(client: Any, address: str, folder: Path) -> None:
    """Refuse workers that cannot do what is asked.

    Raises:
        WallkitError: there is none in ten seconds, or one has another wallkit or does not see the folder.
    """
    try:
        client.wait_for_workers(1, timeout=10)
    except TimeoutError as error:
        hint = f"start one: dask worker {address} --nthreads 1"
        raise WallkitError("the scheduler has no workers", where=address, hint=hint) from error
    for name, (version, sees) in sorted(client.run(_about_worker, str(folder), on_error="return").items()):
        if isinstance(version, BaseException) or version != wallkit.__version__:
            hint = "install the same wallkit everywhere, and start the workers again"
            raise WallkitError(
                f"has wallkit {version}, this is {wallkit.__version__}", where=f"worker {name}", hint=hint
            )
        if not sees:
            hint = "--out must be on a folder that all machines share, under one path"
            raise WallkitError(f"does not see {folder}", where=f"worker {name}", hint=hint)


def _about_worker(folder: str) -> tuple[str, bool]:
    return wallkit.__version__, Path(folder).is_dir()
