"""A scheduler and two workers, forked from a process that has done the imports: real processes on loopback, sooner there."""

from __future__ import annotations

import asyncio
import importlib
import os
import signal
import sys
from pathlib import Path

from distributed import Scheduler, Worker

NEEDED = ("wallkit.pipelines.batch.jobs", "wallkit.pipelines.seeds", "wallkit.localize.filter", "cv2")


def serve(folder: Path) -> None:
    """The address of the scheduler as a line, then until the pipe ends."""
    for name in NEEDED:
        importlib.import_module(name)
    read, write = os.pipe()
    children = [_forked(_scheduler, write)]
    address = os.read(read, 200).decode()
    children += [_forked(_worker, address, str(folder / f"w{i}")) for i in range(2)]
    print(address, flush=True)
    sys.stdin.read()
    for pid in children:
        os.kill(pid, signal.SIGKILL)
        os.waitpid(pid, 0)


def _forked(main, *words) -> int:
    pid = os.fork()
    if pid == 0:
        asyncio.run(main(*words))
        os._exit(0)
    return pid


async def _scheduler(write: int) -> None:
    async with Scheduler(host="127.0.0.1", port=0, dashboard_address="127.0.0.1:0") as scheduler:
        os.write(write, scheduler.address.encode())
        await scheduler.finished()


async def _worker(address: str, folder: str) -> None:
    async with Worker(address, nthreads=1, local_directory=folder, dashboard_address="127.0.0.1:0") as worker:
        await worker.finished()


if __name__ == "__main__":
    serve(Path(sys.argv[1]))
