"""`--assemble`: the nearest consistent state, positions first, then velocities, in the mass-weighted norm."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Iterator
from contextvars import ContextVar
from functools import cached_property

import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.compiled import NumericSystem
from lagcli.equations.system import System
from lagcli.errors import diagnostics
from lagcli.frozen import frozen, frozen_value
from lagcli.linear import rank
from lagcli.linear import surface as road
from lagcli.linear.metric_rows import LocalRows, MetricRows, Sparse
from lagcli.start import initial, projection
from lagcli.start.configuration_search import PARAMETERS as SEARCH
from lagcli.start.configuration_search import ConfigurationResult, Search, of_size, tangential
from lagcli.start.initial import Residuals, State


class AssemblyParameters:
    """The nearest consistent configuration; lengths are parts of its size. The tests are of
    `tests/unit/test_numbers_of_starts.py` and `tests/unit/test_start_thresholds.py`."""

    __slots__ = ()

    stuck: float = 1e-5
    """A row whose gradient along the coordinates that may move is this part of the whole one has nothing to move
    (`test_a_row_that_hardly_acts_on_what_may_move_is_stuck`)."""
    near: float = SEARCH.drift
    """A start closer to the surface than this, and than half the radius of curvature, has one nearest point
    (`test_a_start_that_is_near_and_little_curved_has_one_nearest_point`)."""
    curved: float = 0.5
    """The smallest second derivative of the squared distance along the surface: it is less beyond half the radius of
    curvature (`test_a_start_that_is_near_and_little_curved_has_one_nearest_point`)."""


PARAMETERS = AssemblyParameters()


_is_brief: ContextVar[bool] = ContextVar("brief", default=False)


@contextlib.contextmanager
def briefly() -> Iterator[None]:
    """Inside the block a start that violates rows is refused without a search for a state that would satisfy them:
    one of many starts, of which nobody reads more than a line."""
    token = _is_brief.set(True)
    try:
        yield
    finally:
        _is_brief.reset(token)


@frozen_value
class Assembly:
    """A consistent state and how far it lies from the declared one, in the mass-weighted norm."""

    state: State
    moved: float
    moved_velocity: float
    declared: State


def assemble(
    system: System, numeric: NumericSystem, state: State, keep: tuple[str, ...], one_sided: bool = False
) -> Assembly:
    """The nearest consistent state: positions first, then velocities, in the mass-weighted norm.

    keep: names of coordinates that hold their values and rates; one_sided: also on the allowed side of the one-sided
    constraints, in position only. A model without inertia is measured with unit masses. Raises
    `diagnostics.ModelError` where no state is found, naming the smallest set of rows that has none.
    """
    values = tuple(part.tobytes() for part in (state.q, state.v, state.p))
    question = ("assembly", state.t, *values, system.model.simulation.duration, keep, one_sided)
    return numeric.memory.answer(
        question, lambda: _assembled(system, numeric, state, keep, one_sided), (diagnostics.ModelError,)
    )


def _assembled(
    system: System, numeric: NumericSystem, state: State, keep: tuple[str, ...], one_sided: bool
) -> Assembly:
    initial.residuals(system, numeric, state)  # a row may have no value there
    # The coordinates that `keep` names (`theta`, `a`, `a.x`).
    kept = [name in keep or name.partition(".")[0] in keep for name in system.model.coordinate_names]
    search = Search(system, numeric, state, np.array(kept, dtype=bool))
    q = _configuration(search)
    if one_sided and system.contacts.count:
        from lagcli.start import gaps  # here, as most models have no one-sided constraints

        q = gaps.nearest(search, q)
    there = dataclasses.replace(state, q=q)
    _, rows, b = initial.finite_rows(system, numeric, there)
    metric, full_metric = initial.metric_at(numeric, there, search.fixed), initial.metric_at(numeric, there)
    there, is_consistent = projection.consistent(system, numeric, there, metric)
    # Rows that hardly act along the coordinates that may move, and do along the others
    moving = MetricRows(rows.B, metric)
    norms = LocalRows(moving.unit).norms * moving.lengths
    stuck = (norms < PARAMETERS.stuck * MetricRows(rows.B, full_metric).lengths) & (norms > 0)
    if stuck.any() and search.fixed.any():
        left = np.flatnonzero(stuck).tolist()
        message = f"with the coordinates that `keep` holds, nothing is left to satisfy {initial.names_of(system, left)}"
        location, hint = system.rows.rows[left[0]].location, "let `keep` hold fewer coordinates"
        raise diagnostics.error("no-consistent-start", message, location, hint)
    if not is_consistent:
        raise _no_velocity(search, there, rows, b)
    return Assembly(there, full_metric.length(q - state.q), full_metric.length(there.v - state.v), state)


def begin(system: System, numeric: NumericSystem) -> State:
    """The consistent state nearest to the declared one. Raises `diagnostics.ModelError` where there is none, and where
    the inertia has no finite value there."""
    state = assemble(system, numeric, initial.declared(system), ()).state
    if not projection.is_finite(numeric, state):
        initial.inertia(system, numeric, state)  # says of which coordinate
    return state


def configuration(system: System, numeric: NumericSystem, state: State) -> State:
    """The state with the nearest configuration, whatever its velocities. Raises `diagnostics.ModelError`."""
    initial.residuals(system, numeric, state)  # a row may have no value there
    search = Search(system, numeric, state, np.zeros(state.q.size, dtype=bool))
    return dataclasses.replace(state, q=_configuration(search))


def require_consistent(system: System, numeric: NumericSystem, state: State, found: Residuals) -> None:
    """Raise `diagnostics.ModelError` naming every row the start violates, or rows that no start can satisfy."""
    report = initial.inconsistencies(system, found)
    if not report:
        return
    if _is_brief.get():
        raise diagnostics.ModelError(report)
    try:
        assemble(system, numeric, state, ())
    except diagnostics.ModelError as error:
        if any(d.code == "contradictory-constraints" for d in error.diagnostics):
            raise
        report += error.diagnostics
    raise diagnostics.ModelError(report)


def _configuration(search: Search) -> Floats:
    """The configuration on f = 0 nearest to the declared one. Raises `diagnostics.ModelError`."""
    q0, surface, rows = search.state.q, search.surface(), range(search.system.holonomic_count)
    best = surface.nearest(_feasible(search), q0)
    if _is_clearly_nearest(search, best):
        return _polished(search, best)
    _, parts = search.components()

    def lengths(q: Floats) -> Floats:
        """The squared distance of q from the declared configuration, (n,): of each part, at its number."""
        weights = (q - q0) * LocalRows(search.M).times(q - q0)
        return np.asarray(np.bincount(parts, weights, minlength=q.size), dtype=float)

    least, optima = lengths(best), list[Floats]()
    # Some of the starts aside: of few coordinates most
    aside = list(search.neighbours(q0, rows))
    most = of_size(int((~search.fixed).sum()), (16, 3, 1))
    for begin in (best, q0, *aside[:: max(1, len(aside) // most)][:most]):
        # A local minimum of the distance on the surface, by IPOPT or else by Gauss-Newton
        found = search.optimum(rows, begin, q0)
        if found is not None:
            near = doubles.ROOT * float(np.abs(found).max(initial=0.0))
            if any(np.abs(found - other).max(initial=0.0) <= near for other in optima):
                continue
            optima.append(found)
        reached = surface.descend(begin if found is None else found)
        if reached.is_on:
            q = surface.nearest(reached.q, q0, 4)  # which shows where this start leads
            # What shares no coordinate and no row may be near in one solution, and the rest in another.
            nearer = lengths(q) < (1 - doubles.ZERO) * least
            best, least = np.where(nearer[parts], q, best), np.where(nearer, lengths(q), least)
    return _polished(search, surface.nearest(best, q0))


def _feasible(search: Search) -> Floats:
    """Some point of the surface. Raises `diagnostics.ModelError`."""
    labels, parts = search.components()
    q = search.state.q
    B = LocalRows(search.numeric.holonomic(search.state.t, q, search.state.p)[1])
    poles = np.flatnonzero(~B.are_finite())
    if poles.size:  # a little aside where a gradient is not finite: of rods of no length
        q = next(search.neighbours(q, poles.tolist()))
    reached, failed = search.descend(q), list[ConfigurationResult]()
    if not reached.is_on:
        # What has not arrived is sought part by part, and then all again.
        q = reached.q.copy()
        broken = ~(reached.residuals <= doubles.ZERO * initial.size(q)) | reached.recedes
        for number in np.unique(labels[broken]):
            found = search.reach(np.flatnonzero(labels == number).tolist(), (search.state.q, q))
            if found.is_on:
                among = parts == number
                q[among] = found.best.q[among]
            else:
                failed.append(found)
        if not failed:
            reached = search.descend(q)
    if reached.is_on:
        return reached.q
    if not failed:
        found = search.reach(np.flatnonzero(labels >= 0).tolist(), (search.state.q, q))
        if found.is_on:
            return found.best.q
        failed.append(found)
    from lagcli.start import conflict  # here, as most starts are found

    raise diagnostics.ModelError(conflict.position(search, each) for each in failed)


def _is_clearly_nearest(search: Search, q: Floats) -> bool:
    """True if a point of the surface is so near that it is the nearest."""
    q0, many = search.state.q, q.size > SEARCH.many
    moved = search.full_metric.length(q - q0)
    if moved == 0.0:
        return True
    size = search.size(q0, search.touched(range(search.system.holonomic_count)))
    near = doubles.ROOT if many else PARAMETERS.near
    if moved > near * search.full_metric.length(np.where(search.fixed, 0.0, size)):
        return False
    return many or _curvature(search, q) >= PARAMETERS.curved


def _curvature(search: Search, q: Floats) -> float:
    """The smallest eigenvalue, in the metric, of the second derivative of the squared distance along the surface: 1 on
    a plane, above 0 at a minimum, and below PARAMETERS.curved beyond half the radius of curvature."""
    H, B, *_ = _conditions(search, q)
    free = np.flatnonzero(~search.fixed)
    kernel = rank.null_basis(MetricRows(B, search.metric).dense)
    basis = np.array([search.metric.unwhitened(u) for u in kernel.T])
    if not basis.size:
        return 1.0
    return float(np.linalg.eigvalsh(basis[:, free] @ np.array(H)[np.ix_(free, free)] @ basis[:, free].T)[0])


def _conditions(search: Search, q: Floats) -> tuple[Sparse, Sparse, Floats, Floats]:
    """The terms of Newton's method for the nearest point: H (n, n), independent rows B, M (q - q0) (n,), and f."""
    state, step = search.state, q - search.state.q
    chosen = search.independent(range(search.system.holonomic_count), q)
    active = chosen[0] if chosen else []
    f, B = search.surface(active).rows(q)
    lines = MetricRows(B, search.metric)
    mu = np.zeros(search.system.holonomic_count)
    mu[active] = -lines.weights(LocalRows(B).times(step)) / lines.lengths
    H = search.M + search.numeric.hessian(state.t, q, mu, state.p)
    return H, B, LocalRows(search.M).times(step), f


@frozen
class _NearestConditions:
    """The conditions of a point of the surface that is the nearest one, linearized at q."""

    search: Search
    q: Floats

    @cached_property
    def distance(self) -> float:
        search = self.search
        return tangential(search.surface().rows(self.q)[1], search.metric, self.q - search.state.q)

    @property
    def is_there(self) -> bool:
        return self.distance <= doubles.VALUE

    def step(self) -> Floats | None:
        from lagcli.compiled import nearest

        H, B, gradient, f = _conditions(self.search, self.q)
        step = nearest.newton(H, B, gradient, f, ~self.search.fixed)
        reached = self.search.surface().descend(self.q + step) if step is not None else None
        return reached.q - self.q if reached is not None and reached.is_on else None


def _polished(search: Search, q: Floats) -> Floats:
    """A nearest point to rounding, from one to some digits: Newton steps as long as they lead there."""
    end = road.approach(lambda q: _NearestConditions(search, q), q)
    return q if end is None else end.x


def _no_velocity(search: Search, there: State, rows: LocalRows, b: Floats) -> diagnostics.ModelError:
    """The error for rows that no velocity satisfies at the nearest configuration, or none with the rates fixed."""
    from lagcli.start import conflict

    system = search.system
    parting = conflict.least(rows, b)
    if parting:
        return initial.contradiction(system, parting, "at the nearest configuration")
    if search.fixed.any():
        free = ~search.fixed
        fixed_rates = rows.times(np.where(free, 0.0, there.v)) + b
        parting = conflict.least(LocalRows(rows.B[:, np.flatnonzero(free).tolist()]), fixed_rates)
        if parting:
            message = (
                f"with the rates of the coordinates that `keep` holds, no velocity satisfies"
                f" {initial.names_of(system, parting)}"
            )
            hint = "let `keep` hold fewer coordinates, or give them rates that fit"
            location = system.rows.rows[parting[0]].location
            return diagnostics.error("no-consistent-start", message, location, hint)
    broken = initial.residuals(system, search.numeric, there).violated
    message = f"no velocities that satisfy {initial.names_of(system, broken)} were found"
    return diagnostics.error("no-consistent-start", message, system.rows.rows[broken[0]].location)
