"""A plan of measurements -> their messages in order, the pictures made by several processes.

A picture draws from the seed and its own moment only, so it does not matter who makes it, or when.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from dataclasses import dataclass

from wallkit.pipelines.simulate.camera import CameraSensor
from wallkit.pipelines.simulate.play import Message, Play, Sensor

# pictures that are asked for before they are due, of every process
_AHEAD = 4


@dataclass(frozen=True)
class Task:
    """One measurement: by which sensor, truly when, stamped and recorded when [ns from the epoch]."""

    sensor: str
    at_ns: int
    stamp_ns: int
    log_ns: int


def messages_of(
    tasks: Sequence[Task], sensors: Mapping[str, Sensor], make_play: Callable[[], Play], jobs: int
) -> Iterator[tuple[Task, list[Message]]]:
    """Every task with its messages, in the order given.

    Args:
        make_play: makes the same play again in another process, so it must be picklable.
        jobs: processes for pictures; 1 makes them here.
    """
    cameras = [number for number, task in enumerate(tasks) if isinstance(sensors[task.sensor], CameraSensor)]
    if jobs <= 1 or not cameras:
        for task in tasks:
            yield task, list(sensors[task.sensor].measure(task.at_ns, task.stamp_ns))
        return
    import multiprocessing

    # a fresh process: OpenGL does not survive a fork
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, mp_context=context, initializer=_begin, initargs=(make_play,)) as pool:
        asked: dict[int, Future[list[Message]]] = {}
        to_ask = iter(cameras)
        try:
            for number, task in enumerate(tasks):
                while len(asked) < _AHEAD * jobs and (following := next(to_ask, None)) is not None:
                    asked[following] = pool.submit(_picture, tasks[following])
                if number in asked:
                    yield task, asked.pop(number).result()
                else:
                    yield task, list(sensors[task.sensor].measure(task.at_ns, task.stamp_ns))
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


# -------------------------------------------------------------------------------------- in the other process

_ours: dict[str, Play] = {}


def _begin(make_play: Callable[[], Play]) -> None:
    _ours["play"] = make_play()


def _picture(task: Task) -> list[Message]:
    play = _ours["play"]
    setup = next(s for s in play.scenario.cameras if f"camera {s.name}" == task.sensor)
    return list(CameraSensor(play, setup).measure(task.at_ns, task.stamp_ns))
