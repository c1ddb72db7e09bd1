"""The search for a loop that shows a row to be nonholonomic: configurations, parts and sizes in their order, and the
words of moves that are tried."""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import math
from collections.abc import Iterator
from functools import cached_property, partial

import numpy as np

from lagcli import doubles
from lagcli.analysis.holonomy import controlled_paths, loop_words
from lagcli.analysis.holonomy.controlled_paths import PathOrbit
from lagcli.analysis.holonomy.local_system import LARGEST, LocalPart, LoopTimeUpError, around
from lagcli.analysis.holonomy.loop_words import Goal
from lagcli.analysis.holonomy.witness import LoopTrial, Witness
from lagcli.arrays import Floats, Integers
from lagcli.compiled import NumericSystem
from lagcli.equations.system import System
from lagcli.linear import independent_rows
from lagcli.start import assembly, initial, projection
from lagcli.start.initial import State


class WitnessSearchParameters:
    """The order of the search. The tests are of `tests/unit/test_numbers_of_flags_and_loops.py`."""

    __slots__ = ()

    usual: tuple[float, ...] = (1.0, 0.5, 0.2, 0.1)
    """Sizes of loops, in the order in which they are tried.
    `test_sizes_of_loops_are_tried_from_usual_ones_to_far_ones`."""
    far: tuple[float, ...] = (0.02, 10.0, 100.0, 1e-3)
    """Sizes that come last, with round lengths alone: few systems need them.
    `test_sizes_of_loops_are_tried_from_usual_ones_to_far_ones`."""
    bent: float = 0.5
    """The angle by which holonomic rows are turned in them, rad. `test_holonomic_rows_are_turned_by_half_a_radian`."""
    drawn: float = 0.7
    """The part that is left of the distances of particles from those of the row.
    `test_particles_are_drawn_together_to_seven_tenths`."""
    combinations: int = 200
    """Sets of coordinates up to which all are tried. `test_up_to_two_hundred_sets_of_coordinates_all_are_tried`."""
    many: int = 1
    """Conditions up to which all words of round lengths are tried.
    `test_of_one_condition_two_goals_are_tried_and_of_more_one`."""


PARAMETERS = WitnessSearchParameters()
# Of random directions; a fixed one: the witness must not change from run to run.
SEED = 2023


def find(system: System, numeric: NumericSystem, row: str, deadline: float) -> Witness | None:
    """A witness for a row by name, or None where none was found before the deadline (see `progress.after`). Raises
    `diagnostics.ModelError` where no consistent configuration is found, `KeyError` for an unknown row."""
    numbers = {r.name: number for number, r in enumerate(system.rows.rows)}
    number, declared = numbers[row], assembly.assemble(system, numeric, initial.declared(system), ()).state

    def states() -> Iterator[tuple[int, State | None]]:
        """The declared configuration, three bent ones, and three beside the declared one."""
        yield 0, declared
        for seed in range(3 if system.holonomic_count else 0):
            yield 0, _bent(system, numeric, declared, number, seed)
        yield from ((shift, declared) for shift in (1, 2, 3))

    with contextlib.suppress(LoopTimeUpError):
        for shift, state in states():
            everywhere = [] if state is None else around(system, numeric, state, number, deadline)
            parts = [part for part in everywhere if part.k <= LARGEST]
            found = _found(parts, len(parts) == len(everywhere), shift)
            if found is not None:
                is_bent = state is not declared
                return dataclasses.replace(found, is_shifted=shift > 0 or is_bent, is_bent=is_bent)
    return None


def _bent(system: System, numeric: NumericSystem, state: State, row: int, seed: int) -> State | None:
    """A configuration on the surface in which particles are closer to those of a row, and holonomic rows turned. Where
    a chain is straight no part of it can move between ends that are fixed; drawn together it has room. None where no
    way back to the surface is found."""
    noise = np.random.default_rng(seed).standard_normal(state.q.size)
    here, there = (
        numeric.rows(state.t, q, state.v, state.p)[0] for q in (state.q, state.q + doubles.ROOT * noise)
    )
    row_of, column = (np.array(x) for x in (here.sparsity().row(), here.sparsity().get_col()))
    is_holonomic = row_of < system.holonomic_count
    squares = (np.array(x.nonzeros())[is_holonomic] ** 2 for x in (there - here, here))
    turned, lengths = (
        np.sqrt(np.bincount(row_of[is_holonomic], each, system.holonomic_count)) for each in squares
    )
    with np.errstate(all="ignore"):
        rates = turned / lengths / doubles.ROOT
    rates = rates[np.isfinite(rates) & (rates > 0)]
    q = state.q + (PARAMETERS.bent / float(np.median(rates)) if rates.size else PARAMETERS.bent) * noise
    count = state.q.size - len(system.model.generalized_names)  # components of particles come first
    touched = np.unique(column[row_of == row])
    if (touched < count).any():
        centre = state.q[:count].reshape(-1, 3)[touched[touched < count] // 3].mean(axis=0)
        q[:count] -= np.ravel((1 - PARAMETERS.drawn) * (state.q[:count].reshape(-1, 3) - centre))
    surface = projection.Surface(numeric, state.t, state.p, initial.metric_at(numeric, state))
    reached = surface.descend(q)
    return dataclasses.replace(state, q=reached.q) if reached.is_on else None


def _found(parts: list[LocalPart], is_whole: bool, shift: int) -> Witness | None:
    """The first witness, in two parts at a time, the smaller ones first."""
    for group in (parts[first : first + 2] for first in range(0, len(parts), 2)):
        searches = list(_searches(group, shift, is_whole and group[-1] is parts[-1]))
        # Words that close by themselves have round lengths; then those whose lengths must be solved for, at last so
        # that the coordinate moves by a round amount. Sizes far from one come last: few systems need them.
        stages = (
            (_WitnessSearch.words, LoopTrial.closing, PARAMETERS.usual),
            (_WitnessSearch.words, LoopTrial.solved, PARAMETERS.usual),
            (partial(_WitnessSearch.words, are_long=True), LoopTrial.shaped, PARAMETERS.usual),
            (_WitnessSearch.paths, LoopTrial.shaped, PARAMETERS.usual[:2]),
            (_WitnessSearch.words, LoopTrial.closing, PARAMETERS.far),
        )
        for trials, attempt, sizes in stages:
            for search in searches:
                for trial in trials(search) if search.size in sizes else ():
                    found = attempt(trial)
                    if found is not None:
                        return found
    return None


def _searches(parts: list[LocalPart], shift: int, is_whole: bool) -> Iterator[_WitnessSearch]:
    """The searches from the start, or from a point beside it that satisfies the holonomic rows too."""
    if shift == 0:
        parts = [part for part in parts if not controlled_paths.is_singular(part, part.start)]
    # Closed loops first; in time all rows must be kept, so that only a part with all that matters serves.
    kinds = [(part, False) for part in parts]
    if parts and is_whole and parts[-1].knows_time:
        kinds.append((parts[-1], True))
    orbits: dict[tuple[int, bool, bytes], PathOrbit] = {}
    for size, (part, timed) in itertools.product((*PARAMETERS.usual, *PARAMETERS.far), kinds):
        base = part.start
        if shift:
            weights = np.array([(1 + i * shift) % (shift + 1) + 1 for i in range(part.k)]) / 2
            if (part.rows >= part.system.holonomic_count).all():
                base = np.append(base[:-1] + size * weights, base[-1])
            else:
                found = controlled_paths.through(part, base, size, timed=False)
                if found is None:
                    continue
                control = np.zeros((1, 1, found.kernel.shape[1] + 1))
                control[0, 0, :-1] = size * found.kernel.T @ weights
                frame = controlled_paths.projected(part, found.kernel)
                base = controlled_paths.ends(frame, base, control, 16)[0]
                if not np.isfinite(base).all():
                    continue
        yield _WitnessSearch(part, base, size, timed, orbits)


@dataclasses.dataclass(frozen=True)
class _WitnessSearch:
    """The search from one base, at one size, with t fixed or not."""

    part: LocalPart
    base: Floats
    size: float
    timed: bool
    orbits: dict[tuple[int, bool, bytes], PathOrbit]

    def words(self, are_long: bool = False) -> list[LoopTrial]:
        """Words of moves along axes; are_long: those of which all round lengths would be too many."""
        return [trial for trial in self._every_word if (trial.extra > PARAMETERS.many) is are_long]

    def paths(self) -> Iterator[LoopTrial]:
        """Paths of any shape; of too many goals, those of the coordinates in which the orbit's points differ most."""
        free = np.array([self.part.k] if self.timed else [], dtype=np.int64)
        for found, along in self._movable:
            frame = controlled_paths.projected(self.part, found.kernel)
            others = max(0, found.tangent.shape[1] - free.size - 1)
            if math.comb(self.part.k - 1, others) <= PARAMETERS.combinations:
                goals = list(self._goals(found, along, free))
            else:
                closed = _pivots(found.tangent.T, along)[1 : found.tangent.shape[1]]
                is_crossed = self._is_crossed(found.lift(np.append(closed, along)))
                goals = [Goal(self.base, along, closed, self.size)] if is_crossed else []
            for goal, segments in itertools.product(goals, (4, 6)):
                yield LoopTrial(goal, *loop_words.free_paths(frame, self.size, self.timed, segments))

    @cached_property
    def _every_word(self) -> list[LoopTrial]:
        """Words of moves along free coordinates, for each choice of them."""
        turns = np.pi / 4 * min(1.0, self.size) / self.part.scale[:-1]
        units = np.append(np.where(self.part.angles, turns, self.size), self.size)
        trials = []
        for found, along in self._movable:
            for axes in self._frames(found, along):
                own, m = units[list(axes.free)], len(axes.free)
                for goal in self._goals(found, along, np.array(axes.free, dtype=np.int64)):
                    extra = goal.closed.size - m
                    if self.timed:
                        tries = [loop_words.words_in_time(axes, m, i, own, extra) for i in range(m - 1)]
                    else:
                        pairs = itertools.permutations(range(m), 2)
                        tries = [loop_words.loops(axes, m, pair, own, extra) for pair in pairs]
                    trials += [LoopTrial(goal, words, grid) for words, grid in tries]
        return trials

    @cached_property
    def _movable(self) -> list[tuple[PathOrbit, int]]:
        """The orbit, and each coordinate of the row that a reachable direction moves across it, the clearest first."""
        key = (self.part.k, self.timed, self.base.tobytes())
        found = self.orbits.get(key) or controlled_paths.through(self.part, self.base, self.size, self.timed)
        if found is not None and found.is_explored:  # at another size there is no more
            self.orbits[key] = found
        if found is None or not found.tangent.shape[1]:
            return []
        omega = self._omega(self.base)
        rate = omega @ found.tangent
        if np.abs(rate).max(initial=0.0) < controlled_paths.SEEN:
            return []
        clearest = np.argsort(-np.abs(omega[:-1]), kind="stable").tolist()
        seen = [i for i in clearest if abs(omega[i]) > controlled_paths.SEEN]
        return [(found, i) for i in seen[:3]]

    def _omega(self, z: Floats) -> Floats:
        """The row (k + 1,) at a point, of length one."""
        form = self.part.forms(z[None])[0, self.part.row]
        return np.asarray(form / (np.linalg.norm(form) or 1.0))

    def _is_crossed(self, lift: Floats | None) -> bool:
        """True if there are tangent vectors (k + 1, a), and the last of them crosses the row."""
        clearly = 10 * controlled_paths.SEEN
        return lift is not None and bool(abs(self._omega(self.base) @ lift[:, -1]) > clearly)

    def _goals(self, found: PathOrbit, along: int, free: Integers) -> Iterator[Goal]:
        """The coordinates to close besides the free ones; those with the fewest that follow first."""
        missing = found.tangent.shape[1] - free.size - 1
        others = [i for i in range(self.part.k) if i != along and i not in free]
        if missing < 0 or math.comb(len(others), missing) > PARAMETERS.combinations:
            return
        goals = []
        for more in itertools.combinations(others, missing):
            closed = np.array([*free, *more], dtype=np.int64)
            lift = found.lift(np.append(closed, along))
            if lift is not None and self._is_crossed(lift):
                goals.append((np.count_nonzero(lift[:, -1]), Goal(self.base, along, closed, self.size)))
        goals.sort(key=lambda one: one[0])
        yield from (goal for _, goal in goals[: 2 if missing <= PARAMETERS.many else 1])

    def _frames(self, found: PathOrbit, along: int) -> list[controlled_paths.ControlledFrame]:
        """Choices of free coordinates, `along` being led; those that steer best first."""
        part = self.part
        frame = controlled_paths.projected(part, found.kernel)
        random = np.random.default_rng(SEED)
        out = np.zeros((3, 1, found.kernel.shape[1] + 1))
        out[:, 0, :-1] = 0.3 * self.size * random.standard_normal(out[:, 0, :-1].shape)
        points = controlled_paths.ends(frame, self.base, out, 4)
        A = part.forms(points[np.isfinite(points).all(axis=1)])
        if not len(A) or not np.isfinite(A).all():
            return []
        A = A / (np.linalg.norm(A, axis=2, keepdims=True) + 1e-300)
        rank = part.k - found.kernel.shape[1]
        chosen = np.array(independent_rows.leading(A[0][:, :-1], doubles.ROOT)[:rank], dtype=np.int64)
        if chosen.size < rank:
            return []
        others = [i for i in range(part.k) if i != along]
        if math.comb(part.k - 1, rank - 1) <= PARAMETERS.combinations:
            sets = [np.array([along, *led]) for led in itertools.combinations(others, rank - 1)]
        else:
            sets = [_pivots(A[0][chosen][:, :-1], along)]
        ranked = []
        for led in sets:
            worst = max(np.linalg.cond(B) for B in A[:, chosen][:, :, led])
            if worst * doubles.ROOT < 1:
                free = np.setdiff1d(np.arange(part.k), led)
                pure = np.abs(A[:, :, free]).max(axis=(0, 1), initial=0.0) < 1e-12
                steering = int(pure.sum())
                free = free[np.argsort(~pure, kind="stable")]
                free = np.append(free, part.k) if self.timed else free
                axes = controlled_paths.along_axes(part, chosen, led, free)
                ranked.append((-steering, round(math.log10(worst)), axes))
        ranked.sort(key=lambda entry: entry[:2])
        return [axes for *_, axes in ranked[:4]]


def _pivots(rows: Floats, first: int) -> Integers:
    """Columns of rows (r, k) that are independent, `first` before all and then the largest, (r,)."""
    if np.linalg.norm(rows[:, first]) < doubles.ZERO:
        return np.zeros(0, dtype=np.int64)
    chosen = independent_rows.farthest(rows.T, min(rows.shape), [first], least=doubles.ZERO)
    return np.array(chosen, dtype=np.int64)
