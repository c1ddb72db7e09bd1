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
from lagcli.formulations.maggi import Chart, ChartError, DenseFunctions, ReducedMotion
from lagcli.model.settings import Simulation
from lagcli.simulation.scheme import controller, step_tolerance
from lagcli.simulation.stepping.grid import Grid
from lagcli.simulation.stepping.timetable import Timetable

Floats = npt.NDArray[np.float64]

# The most that a step grows from one to the next.
GROW = 6.0
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
    # The columns of R of Cartesian particles and generalized coordinates, in the order of q
    cartesian = [
        name for each in system.model.particles if not each.is_dependent for name in each.members.names
    ]
    names = [f"R.{name}.{axis}" for name in cartesian for axis in "xyz"]
    names += [f"R.{name}" for name in system.model.generalized_names]
    indices = {name: 1 + i for i, name in enumerate(system.columns)}
    columns = [indices[name] for name in names]
    found: list[Floats] = []
    stopped = None
    try:
        for t, motion in _rows(functions, grid, (q, v), settings, statistics):
            lam, R = maggi.reactions(functions, t, motion)
            row = functions.row(t, (motion.q, motion.v, motion.a), lam)
            row[columns] = R
            found.append(row)
    except ReducedStop as stop:
        stopped = stop
    table = np.array(found) if found else np.zeros((0, 1 + len(system.columns)))
    return table + 0.0, statistics, stopped


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
    chart, y, motion = _in_chart(functions, t, begin, statistics)
    functions.settle(t, motion.q)
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
                chart, y, motion = _in_chart(functions, t, (motion.q, motion.v), statistics)
            switch = timetable.switch(t)
            if switch is not None:
                t = min(switch[1], goal)
                try:
                    motion = chart.at(t, y)  # with the same y
                except ChartError as ended:
                    raise ReducedStop(t, str(ended)) from None
                continue
            taken = min(timetable.shortened(t, h), goal - t)
            last = taken == goal - t or goal - t - taken < 1e-12 * taken
            taken = goal - t if last else taken
            error, found = _step(chart, t, taken, (y, motion), tolerance)
            if found is None or not error < 1.0:
                statistics.rejected += 1
                h = taken * (_change(error) if error < np.inf else 0.25)
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
            grown = taken * min(GROW, _change(max(error, 1e-10)))
            h = max(h, grown) if taken < h else grown
        statistics.seconds += time.perf_counter() - began
        yield t, motion


def _in_chart(
    functions: DenseFunctions, t: float, state: tuple[Floats, Floats], statistics: ReducedStatistics
) -> tuple[Chart, Floats, ReducedMotion]:
    """The motion at q and v in a chart around them."""
    statistics.charts += 1
    try:
        chart = Chart(functions, t, *state)
        return chart, chart.y, chart.at(t, chart.y)
    except ChartError as ended:
        raise ReducedStop(t, str(ended)) from None


def _change(error: float) -> float:
    """The part of a step that its error asks for the next one to be."""
    asked: float = controller.PARAMETERS.safety * error ** (-1 / dop853_tableau.ORDER)
    return max(controller.PARAMETERS.shrink, asked)


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
