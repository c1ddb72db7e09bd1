"""The engines of a sweep, which exist elsewhere: this process, processes of this machine, any executor.

Points go out in parts and come back in their order; how many are under way is bounded, so that memory is.
"""

from __future__ import annotations

import concurrent.futures
import contextlib
import dataclasses
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future
from concurrent.futures.process import BrokenProcessPool

from lagcli.api.sweeps import point_task
from lagcli.api.sweeps.point_sources import SweepPoints
from lagcli.api.sweeps.point_task import PointRow, PointTask

# Seconds of work of a part, long beside its way to another process and short beside the wait of a person.
PART_SECONDS = 0.5
# Points of a part; and parts that are under way, for each worker: one that takes long does not keep the others waiting.
MOST_IN_PART, PARTS_EACH = 256, 16
PAUSE = 0.2  # seconds between looks at interrupts while parts are under way
# Times that a pool of processes is made anew when the system has ended one of them.
MOST_POOLS = 3

Finished = tuple[list[PointRow], float]


class WorkersLost(RuntimeError):
    """Processes of the engine were ended again and again; the message names the points that were under way."""


@dataclasses.dataclass(slots=True)
class Engine:
    """An executor with the number of its workers; `renew` makes another one when its processes were ended."""

    executor: Executor | None = None
    workers: int = 1
    renew: Callable[[], Executor] | None = None


@contextlib.contextmanager
def local(jobs: int) -> Iterator[Engine]:
    """This process for one job, else so many processes of this machine, which end with this one."""
    if jobs == 1:
        yield Engine()
        return

    def pool() -> Executor:
        # Spawned on every system: what is forked from a process with threads may wait for ever.
        import multiprocessing

        context = multiprocessing.get_context("spawn")
        return concurrent.futures.ProcessPoolExecutor(jobs, context, initializer=_begin_worker)

    engine = Engine(pool(), jobs, pool)
    try:
        yield engine
    finally:
        assert engine.executor is not None
        engine.executor.shutdown(wait=False, cancel_futures=True)
        _end_workers()


@contextlib.contextmanager
def given(executor: Executor) -> Iterator[Engine]:
    """An executor of the caller. One that does not say how many workers it has is taken to have one a processor."""
    workers = getattr(executor, "_max_workers", None)
    yield Engine(executor, workers if isinstance(workers, int) else os.cpu_count() or 1)


def rows(engine: Engine, task: PointTask, points: SweepPoints, numbers: range) -> Iterator[list[PointRow]]:
    """The rows of these points in their order, in parts; an empty part where none has come for a while.

    Raises what a point raises that is no answer of it, and `WorkersLost`.
    """
    if engine.executor is None:
        yield from _here(task, points, numbers)
    else:
        yield from _Stream(engine, task, points, numbers).rows()


def _here(task: PointTask, points: SweepPoints, numbers: range) -> Iterator[list[PointRow]]:
    size, at = 1, 0
    while at < len(numbers):
        part = numbers[at : at + size]
        found, seconds = point_task.run_points(task, part, [points.point(number) for number in part])
        yield found
        at += len(part)
        size = _size(seconds / len(part), PAUSE)


def _size(seconds: float, wanted: float = PART_SECONDS) -> int:
    """The number of points of a part, of which each takes so many seconds."""
    return max(1, min(MOST_IN_PART, int(wanted / max(seconds, 1e-9))))


class _Stream:
    """Parts of a sweep under way, and those that came before their turn."""

    def __init__(self, engine: Engine, task: PointTask, points: SweepPoints, numbers: range) -> None:
        self._engine, self._task, self._points, self._numbers = engine, task, points, numbers
        self._sent = 0  # of `numbers`
        self._size = 1
        self._parts: dict[int, range] = {}  # sent and not handed out, by the place of their first point
        self._under_way: dict[Future[Finished], int] = {}
        self._come: dict[int, list[PointRow]] = {}
        self._pools = 1

    def rows(self) -> Iterator[list[PointRow]]:
        """See the function `rows`."""
        most = PARTS_EACH * self._engine.workers
        while self._sent < len(self._numbers) or self._parts:
            while self._sent < len(self._numbers) and len(self._parts) < most:
                part = self._numbers[self._sent : self._sent + self._size]
                self._parts[self._sent] = part
                self._send(self._sent)
                self._sent += len(part)
            done, _ = concurrent.futures.wait(self._under_way, PAUSE, concurrent.futures.FIRST_COMPLETED)
            for future in done:
                self._take(future)
            ready: list[PointRow] = []
            while self._parts and (first := next(iter(self._parts))) in self._come:
                ready += self._come.pop(first)
                del self._parts[first]
            yield ready

    def _send(self, first: int) -> None:
        part = self._parts[first]
        points: Sequence[tuple[float, ...]] = [self._points.point(number) for number in part]
        assert self._engine.executor is not None
        try:
            future = self._engine.executor.submit(point_task.run_points, self._task, tuple(part), points)
        except BrokenProcessPool:
            self._renew()
            return
        self._under_way[future] = first

    def _take(self, future: Future[Finished]) -> None:
        if future not in self._under_way:  # of a pool that was given up
            return
        try:
            found, seconds = future.result()
        except BrokenProcessPool:
            self._renew()
            return
        self._come[self._under_way.pop(future)] = found
        self._size = _size(seconds / len(found))

    def _renew(self) -> None:
        """Make the pool anew and send again what was under way. Raises `WorkersLost`."""
        waiting = [first for first in self._parts if first not in self._come]
        self._pools += 1
        if self._engine.renew is None or self._pools > MOST_POOLS:
            named = ", ".join(str(self._parts[first][0]) for first in waiting[:PARTS_EACH])
            raise WorkersLost(
                f"worker processes were ended {self._pools - 1} times, for want of memory perhaps, while the points"
                f" from {named} on were under way"
            )
        self._under_way.clear()
        self._engine.executor = self._engine.renew()
        for first in waiting:
            self._send(first)


def _begin_worker() -> None:
    """A worker leaves interrupts to the process that it works for, and ends with it, however that ends."""
    import multiprocessing

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent.sentinel,), daemon=True).start()


def _end_with(sentinel: int) -> None:
    from multiprocessing import connection

    connection.wait([sentinel])
    os._exit(1)


def _end_workers() -> None:
    """End the processes that this one has started: what they still compute is not wanted."""
    import multiprocessing

    for process in multiprocessing.active_children():
        process.terminate()
