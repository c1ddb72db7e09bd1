"""The engines of a sweep: this process, processes of this machine, any executor.

Points go out in parts and come back in their order; how many are under way is bounded, so that memory is.
"""

from __future__ import annotations

import concurrent.futures
import contextlib
import dataclasses
import functools
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future
from concurrent.futures.process import BrokenProcessPool
from typing import TYPE_CHECKING

from lagcli.api import point_task
from lagcli.api.point_task import PointTask
from lagcli.api.sweep_points import SweepPoints
from lagcli.errors import diagnostics
from lagcli.output.sweeps.sweep_table import PointRow

if TYPE_CHECKING:
    from multiprocessing.connection import Connection


# Seconds of work of a part, long beside its way to another process and short beside the wait of a person.
PART_SECONDS = 0.5
# Points of a part; and parts that are under way, for each worker: one that takes long does not keep the others waiting.
MOST_IN_PART, PARTS_EACH = 256, 16
MOST_NAMED = 8  # points in a message
PAUSE = 0.2  # seconds between looks at interrupts while parts are under way
# Pools of processes that are made with all parts under way, when the system has ended a process of each; then every
# point goes alone, to find the one that is the reason. Points that end their process one after the other, with no other
# point between them, say that it is not the points.
MOST_POOLS, MOST_ENDINGS = 3, 3
PATIENCE = 10.0  # seconds for the scheduler of a cluster to answer
# Workers that may die over one part before it is taken to be the part that ends them.
MOST_DEATHS = 10

Finished = tuple[list[PointRow], float]
ENDED = "the process that ran it was ended by the system, for want of memory perhaps"


class WorkersLost(RuntimeError):
    """Processes of the engine were ended again and again; the message names the points that were under way."""


class NoCluster(RuntimeError):
    """There is no cluster at the address, or no Dask here; the message says which."""


@dataclasses.dataclass(slots=True)
class Engine:
    """An executor with the number of its workers; `renew` makes another one when its processes were ended.

    deadly: what a future raises whose part has ended a worker of an executor that goes on without it; lost: how often
    workers were ended so far.
    """

    executor: Executor | None = None
    workers: int = 1
    renew: Callable[[], Executor] | None = None
    deadly: tuple[type[Exception], ...] = ()
    lost: int = 0


@contextlib.contextmanager
def local(jobs: int) -> Iterator[Engine]:
    """The engine of this machine: this process, or so many that end with this one. Raises `ValueError`."""
    if jobs < 1 or jobs != int(jobs):
        raise ValueError("jobs: a whole number of processes is needed, 1 or more")
    if jobs == 1:
        yield Engine()
        return

    # Spawned on every system: what is forked from a process with threads may wait for ever.
    import multiprocessing
    from multiprocessing import resource_tracker

    if sys.platform != "win32":
        # The process with which Python watches over the semaphores of workers ends with this one: a terminal that hangs
        # up must not end it before the semaphores are gone, as it would print tracebacks.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGHUP})
        try:
            resource_tracker.ensure_running()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
    context = multiprocessing.get_context("spawn")
    # Workers end when the other end of this pipe is closed: what they still compute then is not wanted.
    wanted, end = context.Pipe(duplex=False)

    def pool() -> Executor:
        begin = functools.partial(_begin_worker, wanted)
        return concurrent.futures.ProcessPoolExecutor(jobs, context, initializer=begin)

    engine = Engine(pool(), jobs, pool)
    try:
        yield engine
    finally:
        assert engine.executor is not None
        engine.executor.shutdown(wait=False, cancel_futures=True)
        end.close()
        wanted.close()


def given(executor: Executor) -> contextlib.AbstractContextManager[Engine]:
    """An executor of the caller. One that does not say how many workers it has is taken to have one a processor."""
    workers = getattr(executor, "_max_workers", None)
    return contextlib.nullcontext(
        Engine(executor, workers if isinstance(workers, int) else os.cpu_count() or 1)
    )


@contextlib.contextmanager
def cluster(address: str) -> Iterator[Engine]:
    """The cluster whose scheduler has this address, `tcp://HOST:PORT`. Raises `NoCluster`."""
    try:
        import dask
        import distributed
    except ModuleNotFoundError as error:
        raise NoCluster('a cluster needs Dask, which is not installed: pip install "lagcli[dask]"') from error
    dask.config.set({"distributed.scheduler.allowed-failures": MOST_DEATHS})
    try:
        client = distributed.Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise NoCluster(f"no Dask scheduler answers at {address}: {error}") from None
    with client:
        workers = sum(client.ncores().values())
        # Workers may come later; the scheduler hands out what waits.
        executor = client.get_executor(pure=False, retries=MOST_DEATHS)
        yield Engine(executor, max(1, workers), deadly=(distributed.KilledWorker,))


def rows(engine: Engine, task: PointTask, points: SweepPoints, numbers: range) -> Iterator[list[PointRow]]:
    """The rows of these points in their order, in parts; an empty part where none has come for a while.

    Raises what a point raises that is no answer of it, and `WorkersLost`.
    """
    if engine.executor is None:
        size, at = 1, 0
        while at < len(numbers):
            part = numbers[at : at + size]
            found, seconds = point_task.run_points(task, part, [points.point(number) for number in part])
            yield found
            at += len(part)
            size = _size(seconds / len(part), PAUSE)
    else:
        yield from _Stream(engine, task, points, numbers).rows()


def _size(seconds: float, wanted: float = PART_SECONDS) -> int:
    """The number of points of a part, of which each takes so many seconds."""
    return max(1, min(MOST_IN_PART, int(wanted / max(seconds, 1e-9))))


class _Stream:
    """Parts of a sweep under way, and those that came before their turn."""

    def __init__(self, engine: Engine, task: PointTask, points: SweepPoints, numbers: range) -> None:
        self._engine, self._task, self._points, self._numbers = engine, task, points, numbers
        self._sent = 0  # of `numbers`
        self._size = 1
        self._parts: dict[int, range] = {}  # sent and not handed out, by the index of their first point
        self._under_way: dict[Future[Finished], int] = {}
        self._come: dict[int, list[PointRow]] = {}
        self._has_come = False
        self._pools = 1
        # Indices of points that go one at a time, when nothing else is under way: after all pools were lost, or after
        # workers of an executor have died over their part.
        self._alone: list[int] = []
        self._endings = 0  # of workers by points that went alone, since one has come

    def rows(self) -> Iterator[list[PointRow]]:
        """See the function `rows`."""
        while self._sent < len(self._numbers) or self._parts:
            most = PARTS_EACH * self._engine.workers
            while not self._alone and self._sent < len(self._numbers) and len(self._parts) < most:
                first, self._sent = self._sent, min(self._sent + self._size, len(self._numbers))
                self._parts[first] = self._numbers[first : self._sent]
                self._send(first)
            if self._alone and not self._under_way:
                self._send(self._alone[0])
            done, _ = concurrent.futures.wait(self._under_way, PAUSE, concurrent.futures.FIRST_COMPLETED)
            for future in done:
                if future in self._under_way:  # else of a pool that was given up
                    self._take(future, self._under_way.pop(future))
            ready: list[PointRow] = []
            while self._parts and (first := next(iter(self._parts))) in self._come:
                ready += self._come.pop(first)
                del self._parts[first]
            yield ready

    def _send(self, first: int) -> None:
        numbers = tuple(self._parts[first])
        points = [self._points.point(number) for number in numbers]
        assert self._engine.executor is not None
        try:
            future = self._engine.executor.submit(point_task.run_points, self._task, numbers, points)
        except BrokenProcessPool:
            self._renew()
        else:
            self._under_way[future] = first

    def _take(self, future: Future[Finished], first: int) -> None:
        """Take what has come of a part. Raises what it has raised, and `WorkersLost`."""
        try:
            found, seconds = future.result()
        except BrokenProcessPool:
            if self._alone:
                self._end_alone()
            self._renew()
        except concurrent.futures.CancelledError:
            raise self._lost("the executor has ended") from None
        except self._engine.deadly:
            self._engine.lost += 1
            if first in self._alone:
                self._end_alone()
            else:  # it may have done nothing but stand behind the one that has
                self._alone += self._singly([first])
        else:
            self._has_come, self._endings = True, 0
            self._come[first] = found
            self._size = _size(seconds / len(found))
            if first in self._alone:
                self._alone.remove(first)
                self._pools = 1  # when the last of them is there, parts go out as before

    def _singly(self, indices: Sequence[int]) -> list[int]:
        """Divide parts at these indices into parts of one point; the indices of these."""
        found = [index + i for index in indices for i in range(len(self._parts[index]))]
        self._parts |= {index: self._numbers[index : index + 1] for index in found}
        self._parts = dict(sorted(self._parts.items()))
        return found

    def _end_alone(self) -> None:
        """Make a row of the point that went alone when its worker was ended."""
        self._endings += 1
        if self._endings > MOST_ENDINGS:
            raise self._lost()
        first, self._pools = self._alone.pop(0), 1
        number = self._parts[first][0]
        self._come[first] = [point_task.stopped(self._task, number, self._points.point(number), ENDED)]

    def _renew(self) -> None:
        """Make the pool anew and send again what was under way. Raises `WorkersLost`."""
        self._engine.lost += 1
        if self._engine.renew is None:
            raise self._lost()
        self._under_way.clear()
        self._engine.executor = self._engine.renew()
        if self._alone:
            return
        self._pools += 1
        waiting = [first for first in self._parts if first not in self._come]
        if self._pools <= MOST_POOLS:
            executor = self._engine.executor
            for first in waiting:
                self._send(first)
                if self._engine.executor is not executor:
                    break  # to the next one everything has been sent
        elif self._has_come:
            self._alone = self._singly(waiting)
        else:
            raise self._lost()

    def _lost(self, what: str = "") -> WorkersLost:
        waiting = [str(self._parts[first][0]) for first in self._parts if first not in self._come]
        what = what or f"worker processes were ended {self._engine.lost} times, for want of memory perhaps,"
        named = ", ".join(waiting[:MOST_NAMED])
        return WorkersLost(f"{what} while the points from {named} on were under way")


def _begin_worker(wanted: Connection) -> None:
    """A worker leaves interrupts to the process that it works for, and ends with it, however that ends."""
    import multiprocessing
    from multiprocessing import connection

    diagnostics.leave_arithmetic_unsaid()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    ends: list[Connection | int] = [wanted] if parent is None else [wanted, parent.sentinel]

    def end() -> None:
        connection.wait(ends)
        os._exit(1)

    threading.Thread(target=end, daemon=True).start()
