"""The run of a system reduced by its null space: steps of DOP853 in the independent quantities of a chart."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.compiled import dop853_tableau
from lagcli.equations.system import System
from lagcli.formulations import maggi
from lagcli.formulations.dense_functions import DenseFunctions
from lagcli.formulations.maggi import Chart, ChartError, ReducedMotion
from lagcli.model.settings import Simulation
from lagcli.simulation.scheme import controller, step_tolerance
from lagcli.simulation.stepping.grid import Grid
from lagcli.simulation.stepping.timetable import Timetable

Floats = npt.NDArray[np.float64]

# Part of the step that the error asks for, and bounds of its change from one step to the next.
SAFETY, SHRINK, GROW = 0.9, 0.2, 6.0
# The first step, as a part of the time in which the velocities would move the configuration by its size.
FIRST = 1e-2
# A chart is left where its null space has turned so far that a basis of it has grown by this factor.
TURNED = 1.5
A = [np.array(row) for row in dop853_tableau.A]
B, E5 = np.array(dop853_tableau.B), np.array(dop853_tableau.E5)
E3 = np.array(dop853_tableau.E3)


class ReducedStop(Exception):
    """No step leads on; `t` is the time reached."""

    def __init__(self, t: float, reason: str) -> None:
        super().__init__(reason)
        self.t = t


@dataclasses.dataclass
class ReducedStatistics:
    """Accepted steps, those rejected, charts, and seconds."""

    steps: int = 0
    rejected: int = 0
    charts: int = 0
    seconds: float = 0.0


def run(
    system: System, grid: Grid, begin: tuple[Floats, Floats, Floats], settings: Simulation
) -> tuple[Floats, ReducedStatistics, ReducedStop | None]:
    """Rows (k, 1 + columns) of a system from q, v (n,) with parameters p; why it stopped, where it did."""
    q, v, p = begin
    functions, statistics = DenseFunctions(system, p), ReducedStatistics()
    columns = _reaction_columns(system)
    found: list[Floats] = []
    stopped = None
    try:
        for t, motion in _rows(functions, grid, (q, v), settings, statistics):
            lam = maggi.multipliers(functions, t, motion)
            row = functions.row(t, (motion.q, motion.v, motion.a), lam)
            row[columns] = maggi.reaction(functions, t, motion)
            found.append(row)
    except ReducedStop as stop:
        stopped = stop
    table = np.array(found) if found else np.zeros((0, 1 + len(system.columns)))
    return table + 0.0, statistics, stopped


def _reaction_columns(system: System) -> list[int]:
    """The columns of R of Cartesian particles and generalized coordinates, in the order of q."""
    model = system.model
    cartesian = [name for p in model.particles if not p.is_dependent for name in p.members.names]
    names = [*(f"R.{name}.{axis}" for name in cartesian for axis in "xyz")]
    names += [f"R.{name}" for name in model.generalized_names]
    columns = {name: 1 + i for i, name in enumerate(system.columns)}
    return [columns[name] for name in names]


def _rows(
    functions: DenseFunctions,
    grid: Grid,
    begin: tuple[Floats, Floats],
    settings: Simulation,
    statistics: ReducedStatistics,
) -> Iterator[tuple[float, ReducedMotion]]:
    """The motion at each time of the grid, from q and v at its start. Raises `ReducedStop`."""
    began = time.perf_counter()
    t = grid.start
    try:
        chart = Chart(functions, t, *begin)
        motion = chart.at(t, chart.y)
    except ChartError as ended:
        raise ReducedStop(t, str(ended)) from None
    statistics.charts += 1
    functions.settle(t, motion.q)
    y = chart.y
    tolerance = step_tolerance.of_steps(settings)
    h = _first(motion, grid)
    timetable = Timetable(functions.timed, t, grid.step, settings.max_step or np.inf)
    statistics.seconds += time.perf_counter() - began
    pace_from = t
    yield t, motion
    for i in range(1, grid.count):
        began = time.perf_counter()
        goal = grid.time(i)
        while t < goal:
            if chart.turned(t, motion) > TURNED:
                chart, y, motion = _renewed(functions, t, motion, statistics)
            switch = timetable.switch(t)
            if switch is not None:
                t = min(switch[1], goal)
                motion = _again(chart, t, y)
                continue
            taken = min(timetable.shortened(t, h), goal - t)
            last = taken == goal - t or goal - t - taken < 1e-12 * taken
            taken = goal - t if last else taken
            error, found = _step(chart, t, taken, (y, motion), tolerance)
            if found is None or not error < 1.0:
                statistics.rejected += 1
                h = taken * (
                    max(SHRINK, SAFETY * error ** (-1 / dop853_tableau.ORDER)) if error < np.inf else 0.25
                )
                if t + h / 64 == t:
                    raise ReducedStop(
                        t, "the steps become too small: the rows are dependent, or the forces too steep"
                    )
                continue
            statistics.steps += 1
            y, motion = found
            t = goal if last else t + taken
            if statistics.steps % controller.PARAMETERS.pace == 0:
                pace_from, advanced = t, t - pace_from
                if controller.is_hopeless(advanced, grid.end - t, grid.step):
                    raise ReducedStop(
                        t,
                        f"the last {controller.PARAMETERS.pace} steps advanced by {advanced:.2g}: the run is too long",
                    )
            functions.settle(t, motion.q)
            grown = taken * min(GROW, max(SHRINK, SAFETY * max(error, 1e-10) ** (-1 / dop853_tableau.ORDER)))
            h = max(h, grown) if taken < h else grown
        statistics.seconds += time.perf_counter() - began
        yield t, motion


def _renewed(
    functions: DenseFunctions, t: float, motion: ReducedMotion, statistics: ReducedStatistics
) -> tuple[Chart, Floats, ReducedMotion]:
    """The motion in a chart around it."""
    statistics.charts += 1
    try:
        chart = Chart(functions, t, motion.q, motion.v)
        return chart, chart.y, chart.at(t, chart.y)
    except ChartError as ended:
        raise ReducedStop(t, str(ended)) from None


def _again(chart: Chart, t: float, y: Floats) -> ReducedMotion:
    """The motion at another time with the same y."""
    try:
        return chart.at(t, y)
    except ChartError as ended:
        raise ReducedStop(t, str(ended)) from None


def _first(motion: ReducedMotion, grid: Grid) -> float:
    speed = float(np.abs(motion.v).max(initial=0.0))
    size = float(np.abs(motion.q).max(initial=0.0)) or 1.0
    push = float(np.abs(motion.a).max(initial=0.0))
    scale = min(size / speed if speed else np.inf, np.sqrt(size / push) if push else np.inf)
    return float(min(FIRST * scale, (grid.end - grid.start) or 1.0))


def _step(
    chart: Chart, t: float, h: float, begin: tuple[Floats, ReducedMotion], tolerance: Floats
) -> tuple[float, tuple[Floats, ReducedMotion] | None]:
    """A step from y and the motion there: its error as a part of the tolerance, and where it leads; infinite where the
    chart ends.

    Hairer's estimate, over the largest component of each kind.
    """
    y, rate = begin[0], begin[1].rate
    chart.stand(begin[1].q)
    stages = np.zeros((dop853_tableau.STAGES, y.size))
    stages[0] = rate
    try:
        for s in range(1, dop853_tableau.STAGES):
            stages[s] = chart.at(t + dop853_tableau.C[s] * h, y + h * (A[s] @ stages[:s])).rate
        new = y + h * (B @ stages)
        motion = chart.at(t + h, new)
    except ChartError:
        return np.inf, None
    d = y.size - chart.freedoms
    sizes = chart.sizes.copy()
    # From rest, or from the origin, a step itself says what is large.
    for part in (slice(0, d), slice(d, None)):
        moved = max(np.abs(values[part]).max(initial=0.0) for values in (y, new, h * rate))
        sizes[part] = np.maximum(sizes[part], moved)
    scale = tolerance[1] + tolerance[0] * sizes + doubles.TINY
    e5 = float(np.abs((E5 @ stages) / scale).max(initial=0.0))
    e3 = float(np.abs((E3 @ stages) / scale).max(initial=0.0))
    # Hypotenuse: squares of large estimates overflow.
    error = h * e5 * (e5 / max(math.hypot(e5, 0.1 * e3), 1e-150))
    return error, (new, motion)
