"""Independent quantities in place of dependent coordinates: the equations of Maggi, without multipliers.

At a reference the velocities that the rows allow are those of the null space of B, with a basis Z that is orthonormal
in the mass metric. Near it, with G = Z^T M of the reference,

    xi = G_h (q - q_ref)    n - s independent coordinates (G_h: the same of the holonomic rows alone)
    u  = G v                n - rank independent quasi-velocities

and [B; G] v = [-b; u] gives v, [B_h; G_h] (q - q_ref) = [..; xi] with f(q, t) = 0 gives q. With N the columns of
[B; G]^-1 that belong to u, so that B N = 0 and G N = 1, virtual displacements are N du, and (D.26) becomes

    N^T (M a - h) = 0,    a = N u' + a_p,    B a_p = gamma

which has no multiplier in it, and is integrated by steps of DOP853. Afterwards B^T lambda = M a - h tells them (D.24).
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Iterator

import casadi as ca
import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.compiled import dop853_tableau, numeric, parts
from lagcli.compiled.bound_function import BoundFunction
from lagcli.equations.system import System
from lagcli.linear import decompositions, rank
from lagcli.model.settings import Simulation
from lagcli.simulation.run_state.between_steps import Turns
from lagcli.simulation.scheme import controller, step_tolerance
from lagcli.simulation.scheme.controller import StepController
from lagcli.simulation.stepping.grid import Grid
from lagcli.simulation.stepping.timetable import Timetable
from lagcli.smoothness import time_functions
from lagcli.smoothness.sized_function import SizedFunction

# Newton's iterations for q, and the change, as a part of the size, that ends them.
ITERATIONS, ARRIVED = 16, 2 * doubles.EPS
# Steps that do not shrink to this part of the one before ask for new derivatives.
SLOW = 0.1
# The most that a step grows from one to the next.
GROW = 6.0
# A chart is left where its null space has turned so far that a basis of it has grown by this factor.
TURNED = 1.5
A = [np.array(row) for row in dop853_tableau.A]
B, E5, E3 = (np.array(row) for row in (dop853_tableau.B, dop853_tableau.E5, dop853_tableau.E3))


class ChartError(Exception):
    """The chart ends here: no configuration is found, or the rows are dependent."""


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class DenseForces:
    """The values that depend on the velocities too: M (n, n), h (n,), gamma (C,); the arrays are the caller's own."""

    M: Floats
    h: Floats
    gamma: Floats
    is_diagonal: bool

    def times(self, X: Floats) -> Floats:
        """M X for X (n,) or (n, k)."""
        return np.asarray((self.M.diagonal() * X.T).T if self.is_diagonal else self.M @ X)


class DenseFunctions:
    """A system at numbers, dense, at one set of parameters p. Nothing in it knows of multipliers."""

    def __init__(self, system: System, p: Floats) -> None:
        symbols, rows, dynamics = system.symbols, system.rows, system.dynamics
        self.n, self.rows, self.holonomic = symbols.q.numel(), len(rows.rows), int(rows.f.numel())
        self._t, self._q, self._v = np.zeros(1), np.zeros(self.n), np.zeros(self.n)
        self._turns, self._last = Turns(system), np.array(p)
        inputs = [symbols.t, symbols.q, system.p]
        outputs = [ca.densify(part) for part in (system.f, rows.B, rows.b)]
        point = SizedFunction("point", inputs, outputs)
        self._point = BoundFunction(point, [self._t, self._q, self._last])
        inputs = [symbols.t, symbols.q, symbols.v, system.p]
        outputs = [ca.densify(part) for part in (dynamics.M, dynamics.h, rows.gamma)]
        forces = SizedFunction("forces", inputs, outputs)
        self._forces = BoundFunction(forces, [self._t, self._q, self._v, np.array(p)])
        self._is_diagonal = bool(dynamics.M.sparsity().is_diag())
        self._record = numeric.table(system, parts.build(system))
        self._p = p
        self.timed = time_functions.functions(system.model)

    def settle(self, t: float, q: Floats) -> None:
        """Angles with a cut are counted on from where they are at t, q (n,), a state of the motion."""
        self._turns.settle(t, q, self._last)

    def point(self, t: float, q: Floats) -> tuple[Floats, Floats, Floats]:
        """f (s,), B (C, n) and b (C,) at t, q (n,); the arrays are the caller's own."""
        self._t[0], self._q[:] = t, q
        self._point.trigger()
        f, B, b = self._point.results
        return f.copy(), B.reshape(self.rows, self.n).copy(), b.copy()

    def forces(self, t: float, q: Floats, v: Floats) -> DenseForces:
        """Inertia, forces and bias at t, q, v (n,)."""
        self._t[0], self._q[:], self._v[:] = t, q, v
        self._forces.trigger()
        M, h, gamma = self._forces.results
        return DenseForces(M.reshape(self.n, self.n).copy(), h.copy(), gamma.copy(), self._is_diagonal)

    def row(self, t: float, state: tuple[Floats, Floats, Floats], lam: Floats) -> Floats:
        """One row of the table, t first, of q, v, a (n,) and lambda (C,)."""
        q, v, a = state
        y, rate = np.concatenate([q, v, [0.0]]), np.concatenate([v, a, [0.0]])
        values = np.array(self._record(t, y, rate, lam, self._p)[0]).ravel()
        return np.concatenate([[t], values])


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class ReducedMotion:
    """q, v, a (n,) at a point of the chart, (xi', u'), and how far the null space of rows has turned (1: not)."""

    q: Floats
    v: Floats
    a: Floats
    rate: Floats
    turned: float


class Chart:
    """Independent quantities y = (xi, u) around a reference t, q, v. Raises `ChartError`."""

    def __init__(self, functions: DenseFunctions, t: float, q: Floats, v: Floats) -> None:
        self._functions, self._q_ref = functions, q
        _, B, _ = functions.point(t, q)
        try:
            lower: Floats = np.asarray(np.linalg.cholesky(functions.forces(t, q, v).M))
        except np.linalg.LinAlgError:
            raise ChartError("the inertia is not positive definite") from None
        self._lower = lower
        s = functions.holonomic
        self._mix, self._G = _split(B, lower)
        self._mix_h, self._G_h = _split(B[:s], lower)
        self.guess = q  # where the search for a configuration begins
        self._inverse_h = _inverse(np.vstack([self._mix_h @ B[:s], self._G_h]))
        self._size = float(np.abs(q).max(initial=0.0)) or 1.0
        self.freedoms, self.rank = len(self._G), len(self._mix)
        self.y = np.concatenate([np.zeros(len(self._G_h)), self._G @ v])
        lengths = np.concatenate([lower.T @ q, [1e-300]])
        self.sizes = np.concatenate([np.full(len(self._G_h), np.abs(lengths).max()), np.zeros(len(self._G))])

    def at(self, t: float, y: Floats) -> ReducedMotion:
        """The motion at y (n - s + n - rank,). Raises `ChartError`."""
        d = len(self._G_h)
        functions, r = self._functions, self.rank
        q = self._position(t, y[:d])
        _, B, b = functions.point(t, q)
        inverse = _inverse(np.vstack([self._mix @ B, self._G]))
        v = inverse @ np.concatenate([-self._mix @ b, y[d:]])
        forces = functions.forces(t, q, v)
        if functions.holonomic == functions.rows:
            self._inverse_h = inverse
        N, a_p = inverse[:, r:], inverse[:, :r] @ (self._mix @ forces.gamma)
        reduced = N.T @ forces.times(N)
        try:
            w = np.linalg.solve(reduced, N.T @ (forces.h - forces.times(a_p)))
        except np.linalg.LinAlgError:
            raise ChartError("the inertia of the independent motions is singular") from None
        a = N @ w + a_p
        if not np.isfinite(a).all():
            raise ChartError("the accelerations are not finite")
        return ReducedMotion(q, v, a, np.concatenate([self._G_h @ v, w]), self._grown(N))

    def turned(self, t: float, motion: ReducedMotion) -> float:
        """The size of a basis of the null space (1: not turned), or of that of holonomic rows, which may turn more."""
        functions, s = self._functions, self._functions.holonomic
        if s == functions.rows:
            return motion.turned
        rows = self._mix_h @ functions.point(t, motion.q)[1][:s]
        try:
            N_h = _inverse(np.vstack([rows, self._G_h]))[:, len(rows) :]
        except ChartError:
            return np.inf
        return max(motion.turned, self._grown(N_h))

    def _grown(self, N: Floats) -> float:
        """The size of a basis (n, d) that has size 1 at the reference."""
        return float(np.linalg.norm(self._lower.T @ N) / np.sqrt(max(1, N.shape[1])))

    def _position(self, t: float, xi: Floats) -> Floats:
        """The configuration with these xi, by Newton's method from the last one, with derivatives while they serve."""
        q: Floats = self.guess
        before = np.inf
        for _ in range(ITERATIONS):
            f, B, _ = self._functions.point(t, q)
            residual = np.concatenate([self._mix_h @ f, self._G_h @ (q - self._q_ref) - xi])
            step = self._inverse_h @ residual
            # Its largest entry as a part of the size of the configuration
            moved = float(np.abs(step).max(initial=0.0)) / self._size
            if moved > SLOW * before and moved > doubles.VALUE:
                self._inverse_h = _inverse(np.vstack([self._mix_h @ B[: len(f)], self._G_h]))
                step = self._inverse_h @ residual
                moved = float(np.abs(step).max(initial=0.0)) / self._size
            if not np.isfinite(moved):
                break
            q = q - step
            if moved <= ARRIVED or (before / 2 <= moved <= doubles.VALUE):
                # There, or rounding: small steps that do not halve
                self.guess = q
                return q
            before = moved
        self.guess = self._q_ref
        raise ChartError("no configuration with these independent coordinates is near")


def _split(B: Floats, lower: Floats) -> tuple[Floats, Floats]:
    """Independent combinations of rows B (C, n), (rank, C), and Z^T M (n - rank, n). Raises `ChartError`."""
    white: Floats = np.asarray(np.linalg.solve(lower, B.T).T)
    lengths = decompositions.lengths(white)
    found = rank.space(white / lengths[:, None])
    if found.value is None:
        raise ChartError("the rank of the rows is undecided")
    return found.combinations / lengths, found.kernel.T @ lower.T


def _inverse(matrix: Floats) -> Floats:
    try:
        return np.asarray(np.linalg.inv(matrix))
    except np.linalg.LinAlgError:
        raise ChartError("the rows are dependent") from None


# Its run: steps of DOP853 in the independent quantities of a chart


class ReducedStop(Exception):
    """No step leads on; `t` is the time reached."""

    def __init__(self, t: float, reason: str) -> None:
        super().__init__(reason)
        self.t = t


@dataclasses.dataclass
class ReducedStatistics:
    """Accepted steps, and seconds."""

    steps: int = 0
    seconds: float = 0.0


def run(
    system: System, grid: Grid, begin: tuple[Floats, Floats, Floats], settings: Simulation
) -> tuple[Floats, ReducedStatistics, ReducedStop | None]:
    """Rows (k, 1 + columns) of a system from q, v (n,) with parameters p; why it stopped, where it did."""
    q, v, p = begin
    functions, statistics = DenseFunctions(system, p), ReducedStatistics()
    # The columns of R of Cartesian particles and generalized coordinates, in the order of q
    indices = {name: 1 + i for i, name in enumerate(system.columns)}
    columns = [indices[f"R.{name}"] for name in system.model.coordinate_names]
    found: list[Floats] = []
    stopped = None
    try:
        for t, motion in _rows(functions, grid, (q, v), settings, statistics):
            # lambda with B^T lambda = R = M a - h, of dependent rows those with the least sum of
            # lambda_i^2 B_i M^-1 B_i^T (D.23, D.24)
            forces = functions.forces(t, motion.q, motion.v)
            R, lam = forces.times(motion.a) - forces.h, np.zeros(0)
            if functions.rows:
                lower = np.linalg.cholesky(forces.M)
                white = np.linalg.solve(lower, functions.point(t, motion.q)[1].T).T
                lam = rank.multipliers(white, np.linalg.solve(lower, R), decompositions.lengths(white))
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
    chart, y, motion = _in_chart(functions, t, begin)
    functions.settle(t, motion.q)
    tolerance = step_tolerance.of_steps(settings)
    # The first step: a hundredth of the time in which the velocities would move the configuration by its size
    speed, size, push = (float(np.abs(part).max(initial=0.0)) for part in (motion.v, motion.q, motion.a))
    size = size or 1.0
    scale = min(size / speed if speed else np.inf, np.sqrt(size / push) if push else np.inf)
    h = float(min(scale / 100, (grid.end - grid.start) or 1.0))
    timetable = Timetable(functions.timed, t, grid.step, settings.max_step or np.inf)
    statistics.seconds += time.perf_counter() - began
    control = StepController(dop853_tableau.ORDER, h, t)
    yield t, motion
    for i in range(1, grid.count):
        began = time.perf_counter()
        goal = grid.time(i)
        while t < goal:
            if chart.turned(t, motion) > TURNED:
                chart, y, motion = _in_chart(functions, t, (motion.q, motion.v))
            switch = timetable.switch(t)
            if switch is not None:
                t = min(switch[1], goal)
                try:
                    motion = chart.at(t, y)  # with the same y
                except ChartError as ended:
                    raise ReducedStop(t, str(ended)) from None
                continue
            taken = min(timetable.shortened(t, control.step), goal - t)
            last = taken == goal - t or goal - t - taken < 1e-12 * taken
            taken = goal - t if last else taken
            error, found = _step(chart, t, taken, (y, motion), tolerance)
            if found is None or not error < 1.0:
                control.step = control.smaller(taken, error, error < np.inf)
                if t + control.step / 64 == t:
                    raise ReducedStop(
                        t, "the steps become too small: the rows are dependent, or the forces too steep"
                    )
                continue
            statistics.steps += 1
            y, motion = found
            t = goal if last else t + taken
            if statistics.steps % controller.PARAMETERS.pace == 0:
                advanced = control.is_too_slow(t, grid.end, grid.step)
                if advanced is not None:
                    raise ReducedStop(
                        t,
                        f"the last {controller.PARAMETERS.pace} steps advanced by {advanced:.2g}: the run is too long",
                    )
            functions.settle(t, motion.q)
            grown = control.grown(taken, error, GROW)
            control.step = max(control.step, grown) if taken < control.step else grown
        statistics.seconds += time.perf_counter() - began
        yield t, motion


def _in_chart(
    functions: DenseFunctions, t: float, state: tuple[Floats, Floats]
) -> tuple[Chart, Floats, ReducedMotion]:
    """The motion at q and v in a chart around them."""
    try:
        chart = Chart(functions, t, *state)
        return chart, chart.y, chart.at(t, chart.y)
    except ChartError as ended:
        raise ReducedStop(t, str(ended)) from None


def _step(
    chart: Chart, t: float, h: float, begin: tuple[Floats, ReducedMotion], tolerance: Floats
) -> tuple[float, tuple[Floats, ReducedMotion] | None]:
    """A step from y and the motion there: its error as a part of the tolerance (Hairer's, over the largest component of
    each kind), and where it leads; infinite where the chart ends."""
    y, rate = begin[0], begin[1].rate
    chart.guess = begin[1].q  # a trial that was given up may have led to another branch
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
