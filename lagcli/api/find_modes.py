"""`lagcli.modes`: the linear equations about the declared start or the nearest equilibrium."""

from __future__ import annotations

import dataclasses
import functools
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from lagcli import doubles, progress
from lagcli.analysis import examined_start, redundancy
from lagcli.api import cache, prepare_run, run_settings
from lagcli.api.cache import CompiledModel
from lagcli.api.load import Path, as_model
from lagcli.compiled import NumericSystem
from lagcli.equations import jump_warnings
from lagcli.errors import diagnostics
from lagcli.linearization import floquet, linear_modes, reference
from lagcli.linearization.linear_modes import Modes
from lagcli.linearization.linearized import LinearizedFunctions, Reference
from lagcli.linearization.reference import Steady
from lagcli.model import settings
from lagcli.model.model import Model
from lagcli.running import table_columns, trajectory
from lagcli.running.trajectory import SimulationStopped
from lagcli.start import initial

if TYPE_CHECKING:
    from lagcli.derivation.sections.linear_section import LinearPoint


ABOUT = ("auto", "start", "equilibrium")
NEAREST = "the start is at rest but is no equilibrium: these are the modes about the nearest equilibrium"
AS_ASKED = "about the nearest equilibrium, as asked for"
FOLLOW = "; to follow the motion from the start, as a large swing that comes back: `--about start`"
NO_MOTION = "the start is no equilibrium and no steady motion"
# Motions are followed so many times the duration of the run, of no more than so many coordinates; the first part of it
# tells whether they are steady.
LONGEST, MOST_FOLLOWED, FIRST = 2.2, 60, 0.02


class NoEquilibriumError(Exception):
    """The motion that is asked for has no modes, or no equilibrium is found; the message says which."""


def start(ready: CompiledModel, limit: float) -> tuple[Reference, tuple[int, ...], tuple[str, ...]]:
    """The state at the start with its multipliers, the contacts that press there, and how far it was moved.

    limit: seconds for the first integrals of differential rows, for which whoever asks `ready` again asks no second
    time. Raises `ModelError`, `SimulationStopped`.
    """
    built = ready.system
    model = built.model
    known = examined_start.examine(built, ready.numeric, None, limit).known
    chosen = run_settings.chosen(model, {"duration": 0.0, "samples": 2})
    prepared = prepare_run.start(model, chosen, known)
    run = trajectory.in_memory(prepared, "*", None, 0.0)
    (t,), (q,), (v,) = table_columns.States(model, run.columns)(run.rows[:1])
    lam = np.array([run[f"lambda.{row.name}"][0] for row in built.multiplier_rows])
    p = initial.declared(built).p
    rows = len(built.rows.rows)
    closed = tuple(j for j in range(built.contacts.count) if lam[rows + j] > 0)
    return Reference(float(t), q, v, np.zeros_like(q), lam, p), closed, prepare_run.moves_of(prepared)


def of_start(model: Model) -> LinearPoint:
    """The declared start as a point of linear equations, or why there are none about it."""
    # SymPy is not loaded by `modes`, which begins at the same point.
    from lagcli.derivation.sections.linear_section import MOST, LinearPoint

    ready = cache.compiled(model)
    count = len(model.coordinate_names)
    if count > MOST:
        return LinearPoint(reason=f"there are {count} coordinates, and they are written out for up to {MOST}")
    try:
        here, closed, _ = start(ready, settings.LIMIT)
    except (diagnostics.ModelError, SimulationStopped):
        return LinearPoint(reason="the declared start is not one that `simulate` begins at")
    functions = LinearizedFunctions(ready.system, closed)
    found = reference.classified(functions, ready.numeric, here, model.simulation.duration or 1.0)
    if found is None:
        return LinearPoint()
    if found.kind == "varying":
        return LinearPoint(reason="the linear equations about the declared start depend on t")
    there = found.here
    rows = len(ready.system.rows.rows)
    taken = [*range(rows), *(rows + j for j in closed)]
    # lambda is 0 where its force is rounding beside the largest force.
    lam, s = there.lam[taken], ready.system.holonomic_count
    B, A = (np.array(part) for part in (found.linear.matrices.B, found.linear.matrices.A))
    forces = np.abs(np.vstack([B[:s], A, B[s:]]) * lam[:, None]).max(axis=1, initial=0.0)
    least = doubles.ZERO * float(found.linear.load.max(initial=0.0))
    multipliers = tuple(float(x) if force > least else 0.0 for x, force in zip(lam, forces, strict=True))
    numbers = (*map(_without_rounding, (there.q, there.v, there.a)), multipliers)
    return LinearPoint(found.kind, there.t, numbers, closed)


def _without_rounding(values: npt.NDArray[np.float64]) -> tuple[float, ...]:
    size = float(np.abs(values).max(initial=0.0))
    return tuple(float(x) if abs(x) > doubles.SUM * size else 0.0 for x in values)


@progress.phase("linearizing")
def modes(
    model: Model | Path,
    *,
    about: str = "auto",
    assemble: bool | None = None,
    limit: float | None = None,
    lowest: int | None = None,
) -> Modes:
    """Return frequencies, eigenvalues, shapes and stability of small deviations (`linear_modes.Modes`).

    About the declared start, if that is an equilibrium or a steady motion whose linear equations do not depend on t,
    else, where it is at rest, about the nearest equilibrium. Of a steady motion whose linear equations have a period in
    t, and of one that comes back to itself, the multipliers of a period are given. A start that moves otherwise is
    refused. about: `start` or `equilibrium` asks for one of them alone, and with `start` any motion that comes back
    will do. assemble: move the start onto the constraints first; limit: seconds for the first integrals of differential
    rows; lowest: how many modes of a model of more than 600 coordinates (20). Angular frequencies in 1/time of the
    model's unit.

    Raises `ModelError`, `ValueError` for bad options, `NoEquilibriumError`, `SimulationStopped`.
    """

    wanted = linear_modes.WANTED if lowest is None else lowest
    if wanted < 1:
        raise ValueError("lowest: a number of modes is needed, 1 or more")
    if about not in ABOUT:
        raise ValueError(f"about: {', '.join(ABOUT[:-1])} or {ABOUT[-1]}")
    model = as_model(model)
    seconds = run_settings.seconds(limit)
    model = dataclasses.replace(model, simulation=run_settings.chosen(model, {"assemble": assemble}))
    linearizing = _Linearizing(cache.compiled(model), seconds, wanted)
    here, closed, moved = start(linearizing.ready, seconds)
    found = linearizing.about_start(here, closed, about)
    if found is None:
        is_followed = here.q.size <= MOST_FOLLOWED and not closed
        if about == "start":
            if here.q.size > MOST_FOLLOWED:
                raise NoEquilibriumError(
                    f"{NO_MOTION}, and whether it comes back is followed in models of up to {MOST_FOLLOWED}"
                    f" coordinates: this one has {here.q.size}"
                )
            raise NoEquilibriumError(f"{NO_MOTION}, and does not come back")
        if about == "auto" and not reference.is_at_rest(here.q, here.v, linearizing.duration):
            line = f"lagcli modes {'MODEL' if model.path.startswith('<') else model.path} --about"
            follow = f"; to see if its motion comes back: `{line} start`" if is_followed else ""
            raise NoEquilibriumError(
                "the start moves, and it is no steady motion whose linear equations have constant coefficients. For the"
                f" modes about the nearest equilibrium: `{line} equilibrium`{follow}"
            )
        note = AS_ASKED if about == "equilibrium" else NEAREST + (FOLLOW if is_followed else "")
        found = linearizing.about_nearest(note)
    return dataclasses.replace(found, notes=(*moved, *found.notes))


class _Linearizing:
    """The modes of a compiled model, so many of a large one; limit: seconds for first integrals."""

    def __init__(self, ready: CompiledModel, limit: float, wanted: int) -> None:
        from lagcli.api.static_points import RestPoints

        self.ready, self._limit, self._wanted = ready, limit, wanted
        self._rest = RestPoints(ready, limit)
        self.duration = ready.system.model.simulation.duration or 1.0

    def about_start(self, here: Reference, closed: tuple[int, ...], about: str) -> Modes | None:
        """The modes about the start, where that is what is wanted and it goes on as it is or comes back."""
        functions = self._functions(closed)
        found = reference.classified(functions, self.ready.numeric, here, self.duration)
        if found is not None and (about != "equilibrium" or found.kind == "equilibrium"):
            where = "about the declared start, an instant of a steady motion"
            if found.kind == "varying":
                where = "about the declared start, which goes on as it is"
            elif found.kind == "equilibrium":
                where = "about the declared start, an equilibrium"
            elif np.any(found.here.a):
                where = (
                    "about the motion from the declared start, which is uniformly accelerated: no steady motion, but"
                    " its linear equations have constant coefficients"
                )
            return self._modes(functions, found, where)
        if about == "equilibrium" or closed or (not np.any(here.v) and about != "start"):
            return None
        if here.q.size > MOST_FOLLOWED:
            return None
        orbit = floquet.FollowedMotion(functions, self._independent(here), here)
        length = LONGEST * self.duration
        if about != "start" and not orbit.is_steady(FIRST * length):
            return None
        path = orbit.path(length)
        T = None if path is None else floquet.period(functools.partial(orbit.signature, path), length)
        if T is None:
            return None
        return linear_modes.of_cycle(
            orbit, T, ("about the motion from the declared start, which comes back",)
        )

    def about_nearest(self, note: str) -> Modes:
        """The modes about the point of rest that the start leads to. Raises `NoEquilibriumError`."""
        system, point = self.ready.system, self._rest.nearest()
        if not point.rests:
            raise NoEquilibriumError(
                "the start is no equilibrium, and none is found from it: the forces that"
                f" are left are {point.residual:.3g} of their size at best"
                + "".join(f"; {sentence}" for sentence in jump_warnings.out_of_sight(system))
            )
        begun, rows = initial.declared(system), len(system.rows.rows)
        nothing = np.zeros_like(point.q)
        here = Reference(begun.t, point.q, nothing, nothing, point.lam, begun.p)
        functions = self._functions(tuple(j for j in point.closed if point.lam[rows + j] > 0))
        there = reference.at_rest(functions, self.ready.numeric, here, self.duration)
        found = self._modes(functions, there, note)
        if found is None:
            raise NoEquilibriumError(
                "the linear equations about the nearest equilibrium depend on t without a period"
            )
        return found

    def _functions(self, closed: tuple[int, ...]) -> LinearizedFunctions:
        """The linear equations, with the leaves of integrable differential rows as holonomic rows."""
        return LinearizedFunctions(
            self.ready.system, closed, self.ready.first_integrals(self._limit).integrals
        )

    def _modes(self, functions: LinearizedFunctions, found: Steady, note: str) -> Modes | None:
        """The modes, or, where the linear equations depend on t, the multipliers of their period, None without one.

        About an equilibrium higher derivatives are looked at where the linear equations do not decide.
        """
        notes: tuple[str, ...] = (note,)
        n = found.here.q.size
        if functions.closed:
            names = ", ".join(f"`{self.ready.system.contacts.rows[j].name}`" for j in functions.closed)
            notes += (f"contacts that press count as rows: {names}",)
        if found.kind == "varying":
            size = float(np.abs(found.linear.values).max(initial=0.0)) or 1.0
            if functions.closed or n > MOST_FOLLOWED:
                return None
            T = floquet.period(
                lambda s: functions.values(reference.moved(found.here, s)) / size, LONGEST * self.duration
            )
            if T is None:
                return None
            orbit = floquet.FollowedMotion(functions, self._independent(found.here), found.here)
            return linear_modes.of_cycle(orbit, T, notes)
        is_minimum: bool | None = None
        if found.kind == "equilibrium" and n <= linear_modes.DENSE:
            point = self._rest.typed(found.here.q, functions.closed)
            if point is not None and point.type.kind is not None:
                is_minimum = point.type.kind == "minimum" and not point.dimension
                if not point.type.is_regular:
                    here = dataclasses.replace(found.here, q=point.point.q, lam=point.point.lam)
                    found = dataclasses.replace(found, here=here, linear=functions.at(here))
        return linear_modes.modes(functions, found, notes, self._wanted, is_minimum)

    def _independent(self, here: Reference) -> NumericSystem:
        """The functions with independent rows at a state."""
        system, numeric = self.ready.system, self.ready.numeric
        chosen, _ = redundancy.begin(system, numeric, initial.State(here.t, here.q, here.v, here.p))
        return numeric.keeping(dataclasses.replace(chosen, inactive=numeric.selection.inactive))
