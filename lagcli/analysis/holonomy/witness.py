"""The proof a teacher would draw that a row is not integrable: found, integrated again, and verified.

The row `omega` of the system is nonholonomic where it does not vanish on the orbit: let tau be the direction of
the orbit in which a coordinate moves and all that is free besides does not. If omega were integrable, some phi
with d phi = mu omega on the allowed displacements would stay constant on every path, while omega(tau) != 0 makes
it move along tau. So one loop with an amount beyond its error is the proof.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable, Iterable, Iterator
from functools import cached_property

import numpy as np
import numpy.typing as npt

from lagcli.analysis.holonomy import controlled_paths, loop_words, path_orbit
from lagcli.analysis.holonomy.local_system import LARGEST, LocalPart, LoopTimeUpError, around
from lagcli.analysis.holonomy.loop_words import Goal, LoopWords
from lagcli.analysis.holonomy.path_orbit import PathOrbit
from lagcli.compiled import NumericSystem
from lagcli.equations.system import System
from lagcli.linear import independent_rows
from lagcli.start import assembly, initial, projection
from lagcli.start.initial import State

Floats = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.int64]

# Sizes of loops, in the order in which they are tried.
SIZES = (1.0, 0.5, 0.2, 0.1, 0.02, 10.0, 100.0, 1e-3)
USUAL = 4  # of the sizes
SHIFTS = 4  # places tried, the start first
CHOICES, MOVABLE = 4, 3  # of led coordinates tried for one goal; of goals
# Sets of coordinates up to which all are tried.
COMBINATIONS = 200
POLE = 1e6  # condition of the led coordinates
CLEAR, FAR = 0.04, 25.0  # of the size of a loop: the least amount worth showing, and how far a loop may reach
NEARLY = 1e-5  # of the size: a word that closes so well closes
SURVEYED, SMOOTH = 200, 1e-4  # closed paths looked at; what their ends may change by with finer steps
NEAR, NEAR_MISS = 8, 1.5  # trials whose lengths are solved for; what they miss by, of what they move
MANY = 1  # conditions up to which all words of round lengths are tried
# Pieces of a loop.
SEGMENTS = (4, 6)
ENOUGH = 2  # solutions among which the simplest is taken, of starts taken at random
NOTHING = 1e-10  # of the size: a move that is left out
SHOWN = 12  # points of a segment
FINEST, COARSEST = 96, 48  # steps in a segment
# Of the size of its points: a path that changes by so little with finer steps is exact, one that changes by more at
# the usual ones is given up.
EXACT, HOPELESS = 3e-12, 1e-6
HOLDS = 1e-11  # |A dz| / (|A| |dz|)
DIGITS = 1e-7  # an amount may not be less certain than this part of it
# A fixed one: the witness must not change from run to run.
SEED = 2023
# Rows of length one that are nearer to those before them depend on them; columns that are nearer are not solved for.
LEAST_ROW, LEAST_PIVOT = 1e-6, 1e-9
TOGETHER = 2  # parts among which the simplest witness is looked for
BENDS, BENT, DRAWN, NUDGE = 3, 0.5, 0.7, 1e-6


@dataclasses.dataclass(frozen=True)
class Path:
    """`corners` (S + 1, k + 1) are the ends of its moves, `points` (T, k + 1) lie along it."""

    corners: Floats
    points: Floats


@dataclasses.dataclass(frozen=True)
class Witness:
    """`coordinate` has moved by `amount`, known to `error`, and `back` have come back.

    One path is a closed loop with t held; of two the second is the one on which the coordinates rest, and the
    amount is the difference of their ends. `follow` are coordinates that constraints tie to the one that moved.
    `row_residual`: the largest |A dz| / (|A| |dz|) along the paths, `surface_residual` the largest |f|, `closure`
    the largest distance of a coordinate in `back` from where it should be. `is_drawn`: each move changes one free
    coordinate. `is_shifted`: the base is not the declared start; `is_bent`: nor is the
    `configuration` (n,) of the whole system, of which what is not in `names` rests. `holds_time`: the rows depend
    on t, which a closed loop holds.
    """

    row: str
    coordinate: str
    amount: float
    error: float
    names: tuple[str, ...]
    back: tuple[str, ...]
    follow: tuple[str, ...]
    free: tuple[str, ...]
    paths: tuple[Path, ...]
    row_residual: float
    surface_residual: float
    closure: float
    is_drawn: bool
    is_shifted: bool
    is_bent: bool
    configuration: Floats
    holds_time: bool

    @property
    def is_timed(self) -> bool:
        """True if two paths over equal times show it."""
        return len(self.paths) == 2

    @property
    def base(self) -> Floats:
        """The begin of the paths, (k + 1,)."""
        start: Floats = self.paths[0].corners[0]
        return start

    def along(self, name: str) -> int:
        """The place of a coordinate in the points."""
        return self.names.index(name)


def find(system: System, numeric: NumericSystem, row: str, deadline: float) -> Witness | None:
    """A witness for a row by name, or None where none was found before the deadline (monotonic clock, s).

    Raises `diagnostics.ModelError` where no consistent configuration is found, `KeyError` for an unknown row.
    """
    names = [r.name for r in system.rows.rows]
    if row not in names:
        raise KeyError(row)
    declared = assembly.assemble(system, numeric, initial.declared(system), ()).state
    try:
        for shift, state in _places(system, numeric, declared, names.index(row)):
            everywhere = around(system, numeric, state, names.index(row), deadline)
            parts = [part for part in everywhere if part.k <= LARGEST]
            found = _found(parts, len(parts) == len(everywhere), shift)
            if found is not None:
                is_bent = state is not declared
                return dataclasses.replace(found, is_shifted=shift > 0 or is_bent, is_bent=is_bent)
    except LoopTimeUpError:
        pass
    return None


def _places(system: System, numeric: NumericSystem, declared: State, row: int) -> Iterator[tuple[int, State]]:
    """The places to begin: at the declared configuration, at bent ones, and beside the declared one."""
    yield 0, declared
    if system.holonomic_count:
        bent = (_bent(system, numeric, declared, row, seed) for seed in range(BENDS))
        yield from ((0, state) for state in bent if state is not None)
    yield from ((shift, declared) for shift in range(1, SHIFTS))


def _bent(system: System, numeric: NumericSystem, state: State, row: int, seed: int) -> State | None:
    """A configuration on the surface in which particles are closer to those of a row, and holonomic rows turned.

    Where a chain is straight no part of it can move between ends that are held; drawn together it has room. None
    where no way back to the surface is found.
    """
    noise = np.random.default_rng(seed).standard_normal(state.q.size)
    here, there = (numeric.rows(state.t, q, state.v, state.p)[0] for q in (state.q, state.q + NUDGE * noise))
    place, column = (np.array(x) for x in (here.sparsity().row(), here.sparsity().get_col()))
    kept = place < system.holonomic_count
    turned, lengths = (
        np.sqrt(np.bincount(place[kept], np.array(x.nonzeros())[kept] ** 2, system.holonomic_count))
        for x in (there - here, here)
    )
    with np.errstate(all="ignore"):
        rates = turned / lengths / NUDGE
    rates = rates[np.isfinite(rates) & (rates > 0)]
    q = state.q + (BENT / float(np.median(rates)) if rates.size else BENT) * noise
    count = state.q.size - len(system.model.generalized_names)  # components of particles come first
    touched = np.unique(column[place == row])
    if (touched < count).any():
        centre = state.q[:count].reshape(-1, 3)[touched[touched < count] // 3].mean(axis=0)
        q[:count] -= np.ravel((1 - DRAWN) * (state.q[:count].reshape(-1, 3) - centre))
    surface = projection.Surface(numeric, state.t, state.p, initial.metric_at(numeric, state))
    try:
        return dataclasses.replace(state, q=surface.feasible(q))
    except projection.NoConfiguration:
        return None


def _found(parts: list[LocalPart], is_whole: bool, shift: int) -> Witness | None:
    """The first witness, in few parts at a time, the smaller ones first."""
    for first in range(0, len(parts), TOGETHER):
        group = parts[first : first + TOGETHER]
        searches = list(_searches(group, shift, is_whole and group[-1] is parts[-1]))
        # Words that close by themselves have round lengths; then those whose lengths must be solved for. Sizes
        # far from one come last: few systems need them.
        usual, far = SIZES[:USUAL], SIZES[USUAL:]
        stages = (
            (_WitnessSearch.closing, usual),
            (_WitnessSearch.solved, usual),
            (_WitnessSearch.shaped, usual),
            (_WitnessSearch.freely, usual[:2]),
            (_WitnessSearch.closing, far),
        )
        for stage, sizes in stages:
            for search in searches:
                found = stage(search) if search.size in sizes else None
                if found is not None:
                    return found
    return None


def _searches(parts: list[LocalPart], shift: int, is_whole: bool) -> Iterator[_WitnessSearch]:
    if shift == 0:
        parts = [part for part in parts if not path_orbit.is_singular(part, part.start)]
    orbits: dict[tuple[int, bool, bytes], PathOrbit] = {}
    for size, (part, timed) in itertools.product(SIZES, _kinds(parts, is_whole)):
        base = _base(part, size, shift)
        if base is not None:
            yield _WitnessSearch(part, base, size, timed, orbits)


def _kinds(parts: list[LocalPart], is_whole: bool) -> Iterator[tuple[LocalPart, bool]]:
    """Closed loops first; in time all rows must be kept, so that only a part with all that matters serves."""
    yield from ((part, False) for part in parts)
    if parts and is_whole and _knows_time(parts[-1]):
        yield parts[-1], True


def _knows_time(part: LocalPart) -> bool:
    """True if t or dt stands in the rows of a part."""
    random = np.random.default_rng(SEED)
    Z = part.start + 0.1 * random.standard_normal((3, part.k + 1))
    later = Z + np.eye(part.k + 1)[-1]
    A = part.forms(Z)
    return bool(A[:, :, -1].any() or (part.forms(later) != A).any())


def _base(part: LocalPart, size: float, shift: int) -> Floats | None:
    """The start, or a point beside it that satisfies the holonomic rows too."""
    start = part.start
    if shift == 0:
        return start
    weights = np.array([(1 + i * shift) % (shift + 1) + 1 for i in range(part.k)]) / 2
    if (part.rows >= part.system.holonomic_count).all():
        return np.append(start[:-1] + size * weights, start[-1])
    found = path_orbit.through(part, start, size, timed=False)
    if found is None:
        return None
    frame = controlled_paths.Projected(part, found.kernel)
    control = np.zeros((1, 1, found.kernel.shape[1] + 1))
    control[0, 0, :-1] = size * found.kernel.T @ weights
    end = controlled_paths.ends(frame, start, control, 16)[0]
    return end if np.isfinite(end).all() else None


@dataclasses.dataclass(frozen=True)
class _Aim:
    """A coordinate that can move, what shall come back with it, and what follows it."""

    along: int
    closed: Numbers
    follow: Numbers


@dataclasses.dataclass(frozen=True)
class _WitnessSearch:
    """The search from one base, at one size, with t held or not."""

    part: LocalPart
    base: Floats
    size: float
    timed: bool
    orbits: dict[tuple[int, bool, bytes], PathOrbit]

    def closing(self) -> Witness | None:
        """A word of moves along axes, of round lengths."""
        return self._first(trial.closing for trial in self._everything if trial.extra <= MANY)

    def solved(self) -> Witness | None:
        """A word of moves along axes, of lengths that are solved for."""
        return self._first(trial.solved for trial in self._everything if trial.extra <= MANY)

    def shaped(self) -> Witness | None:
        """A longer word of moves along axes, solved so that the coordinate moves by a round amount."""
        return self._first(trial.shaped for trial in self._everything if trial.extra > MANY)

    def freely(self) -> Witness | None:
        """A path of any shape, solved so that the coordinate moves by a round amount."""
        if self._orbit is None:
            return None
        return self._first(trial.free for along in self._movable for trial in self._free_trials(along))

    def _first(self, tries: Iterable[Callable[[], Witness | None]]) -> Witness | None:
        for attempt in tries:
            if (found := attempt()) is not None:
                return found
        return None

    @cached_property
    def _orbit(self) -> PathOrbit | None:
        key = (self.part.k, self.timed, self.base.tobytes())
        if key not in self.orbits:
            found = path_orbit.through(self.part, self.base, self.size, self.timed)
            if found is None or not found.is_explored:
                return found  # at another size there may be more
            self.orbits[key] = found
        return self.orbits[key]

    @cached_property
    def _everything(self) -> list[_Trial]:
        return [trial for along in self._movable for trial in self._trials(along)]

    @cached_property
    def _movable(self) -> list[int]:
        """Coordinates of the row that a reachable direction moves across it, the clearest first."""
        found = self._orbit
        if found is None or not found.tangent.shape[1]:
            return []
        omega = self._omega(self.base)
        rate = omega @ found.tangent
        if np.abs(rate).max(initial=0.0) < path_orbit.SEEN:
            return []
        return [
            int(i) for i in np.argsort(-np.abs(omega[:-1]), kind="stable") if abs(omega[i]) > path_orbit.SEEN
        ][:MOVABLE]

    def _omega(self, z: Floats) -> Floats:
        """The row (k + 1,) at a point, of length one."""
        form = self.part.forms(z[None])[0, self.part.row]
        return np.asarray(form / (np.linalg.norm(form) or 1.0))

    def _aims(self, found: PathOrbit, along: int, free: Numbers) -> Iterator[_Aim]:
        """The coordinates to close besides the free ones; those with the fewest that follow first."""
        missing = found.tangent.shape[1] - free.size - 1
        others = [i for i in range(self.part.k) if i != along and i not in free]
        if missing < 0 or math.comb(len(others), missing) > COMBINATIONS:
            return
        aims = []
        for more in itertools.combinations(others, missing):
            closed = np.array([*free, *more], dtype=np.int64)
            lift = found.lift(np.append(closed, along))
            if lift is not None and abs(self._omega(self.base) @ lift[:, -1]) > 10 * path_orbit.SEEN:
                follow = [i for i in np.flatnonzero(lift[:, -1]) if i != along]
                aims.append(_Aim(along, closed, np.array(follow, dtype=np.int64)))
        yield from sorted(aims, key=lambda aim: aim.follow.size)[: 2 if missing <= MANY else 1]

    def _trials(self, along: int) -> Iterator[_Trial]:
        """Words of moves along free coordinates, for each choice of them."""
        turns = np.pi / 4 * min(1.0, self.size) / self.part.scale[:-1]
        units = np.append(np.where(self.part.angles, turns, self.size), self.size)
        found = self._orbit
        assert found is not None
        for axes in self._frames(found, along):
            for aim in self._aims(found, along, axes.free):
                extra = aim.closed.size - axes.free.size
                m = axes.free.size
                if self.timed:
                    tries = [loop_words.journeys(axes, m, i, units[axes.free], extra) for i in range(m - 1)]
                else:
                    pairs = itertools.permutations(range(m), 2)
                    tries = [loop_words.loops(axes, m, pair, units[axes.free], extra) for pair in pairs]
                yield from (_Trial(self, aim, words, grid) for words, grid in tries)

    def _frames(self, found: PathOrbit, along: int) -> list[controlled_paths.Axes]:
        """Choices of free coordinates, `along` being led; those that steer best first."""
        part = self.part
        frame = controlled_paths.Projected(part, found.kernel)
        random = np.random.default_rng(SEED)
        out = np.zeros((3, 1, found.kernel.shape[1] + 1))
        out[:, 0, :-1] = 0.3 * self.size * random.standard_normal(out[:, 0, :-1].shape)
        places = controlled_paths.ends(frame, self.base, out, 4)
        A = part.forms(places[np.isfinite(places).all(axis=1)])
        if not len(A) or not np.isfinite(A).all():
            return []
        A = A / (np.linalg.norm(A, axis=2, keepdims=True) + 1e-300)
        rank = part.k - found.kernel.shape[1]
        chosen = np.array(independent_rows.leading(A[0][:, :-1], LEAST_ROW)[:rank], dtype=np.int64)
        if chosen.size < rank:
            return []
        others = [i for i in range(part.k) if i != along]
        if math.comb(part.k - 1, rank - 1) <= COMBINATIONS:
            sets = [np.array([along, *led]) for led in itertools.combinations(others, rank - 1)]
        else:
            sets = [_pivots(A[0][chosen][:, :-1], along)]
        ranked = []
        for led in sets:
            worst = max(np.linalg.cond(B) for B in A[:, chosen][:, :, led])
            if worst < POLE:
                free = np.setdiff1d(np.arange(part.k), led)
                pure = np.abs(A[:, :, free]).max(axis=(0, 1), initial=0.0) < 1e-12
                steering = int(pure.sum())
                free = free[np.argsort(~pure, kind="stable")]
                free = np.append(free, part.k) if self.timed else free
                ranked.append(
                    (-steering, round(math.log10(worst)), controlled_paths.Axes(part, chosen, led, free))
                )
        ranked.sort(key=lambda entry: entry[:2])
        return [axes for *_, axes in ranked[:CHOICES]]

    def _free_trials(self, along: int) -> Iterator[_Trial]:
        """Paths of any shape."""
        found = self._orbit
        assert found is not None
        frame = controlled_paths.Projected(self.part, found.kernel)
        free = np.array([self.part.k] if self.timed else [], dtype=np.int64)
        for aim, segments in itertools.product(self._any_aims(found, along, free), SEGMENTS):
            yield _Trial(self, aim, *loop_words.free_paths(frame, self.size, self.timed, segments))

    def _any_aims(self, found: PathOrbit, along: int, free: Numbers) -> Iterator[_Aim]:
        """As `_aims`, and where those are too many the coordinates that tell the orbit's points apart best."""
        if math.comb(self.part.k - 1, max(0, found.tangent.shape[1] - free.size - 1)) <= COMBINATIONS:
            yield from self._aims(found, along, free)
            return
        order = _pivots(found.tangent.T, along)
        closed = order[1 : found.tangent.shape[1]]
        lift = found.lift(np.append(closed, along))
        if lift is not None and abs(self._omega(self.base) @ lift[:, -1]) > 10 * path_orbit.SEEN:
            follow = [i for i in np.flatnonzero(lift[:, -1]) if i != along]
            yield _Aim(along, closed, np.array(follow, dtype=np.int64))

    def proved(self, words: LoopWords, x: Floats, aim: _Aim, is_drawn: bool) -> Witness | None:
        """The path integrated ever finer until its end stands, and everything about it measured; None if not so."""
        controls = words.controls(x[None])[0]
        paths = [controls[np.abs(controls).max(axis=1) > NOTHING * self.size]]
        if words.rest is not None:
            paths.append(words.rest)
        laid = [_laid(words.frame, self.base, path) for path in paths]
        if any(one is None for one in laid):
            return None
        points = [one[0] for one in laid if one is not None]
        uncertain = np.sum([one[1] for one in laid if one is not None], axis=0)
        end = points[0][-1] - (points[1][-1] if len(points) > 1 else self.base)
        amount = float(end[aim.along])
        closure = float(np.abs(end[aim.closed]).max(initial=0.0))
        moved = np.abs(end) > NEARLY * self.size
        moved[[aim.along, *aim.closed]] = False
        residual = max(_row_residual(words.frame, p, c) for p, c in zip(points, paths, strict=True))
        size = float(max(np.abs(p).max() for p in points))
        error = float(uncertain[aim.along] + closure + 4 * np.finfo(float).eps * size)
        clear = abs(amount) > CLEAR * self.size and error < DIGITS * abs(amount)
        if not (clear and residual < HOLDS and self._crosses(aim, amount, bool(moved.any()))):
            return None
        part, names, scale = self.part, self.part.names, self.part.scale
        points = [p * scale for p in points]
        steps = [(len(p) - 1) // len(c) for p, c in zip(points, paths, strict=True)]
        return Witness(
            row=part.system.rows.rows[int(part.rows[part.row])].name,
            coordinate=names[aim.along],
            amount=amount * float(scale[aim.along]),
            error=error * float(scale[aim.along]),
            names=names,
            back=tuple(names[i] for i in np.flatnonzero(~moved[:-1]) if i != aim.along),
            follow=tuple(names[i] for i in np.flatnonzero(moved)),
            free=_free_names(words.frame, names),
            paths=tuple(Path(p[::n], p[:: max(1, n // SHOWN)]) for p, n in zip(points, steps, strict=True)),
            row_residual=residual,
            surface_residual=max(part.residual(p[:: max(1, len(p) // 100)] / scale) for p in points),
            closure=float(np.abs(end * scale)[aim.closed].max(initial=0.0)),
            is_drawn=is_drawn,
            is_shifted=False,
            is_bent=False,
            configuration=part.whole(self.base[None])[0],
            holds_time=not self.timed and _knows_time(part),
        )

    def _crosses(self, aim: _Aim, amount: float, is_followed: bool) -> bool:
        """True if the row keeps its sign along the coordinate between the two ends: then any integral changes."""
        if is_followed:
            return True  # the direction itself was tried at the base, and the amount is as small as one likes
        Z = np.repeat(self.base[None], 33, axis=0)
        Z[:, aim.along] += np.linspace(0, amount, 33)
        rate = self.part.forms(Z)[:, self.part.row, aim.along]
        return bool(np.isfinite(rate).all() and ((rate > 0).all() or (rate < 0).all()))


@dataclasses.dataclass(frozen=True)
class _Trial:
    """Words of one kind with trial lengths (N, q), for one aim."""

    search: _WitnessSearch
    aim: _Aim
    words: LoopWords
    lengths: Floats

    @property
    def extra(self) -> int:
        """The number of coordinates that must come back and do not do so by themselves."""
        return int(self.aim.closed.size - self.words.basis.shape[1])

    @property
    def goal(self) -> Goal:
        """The goal of the words."""
        return Goal(self.search.base, self.aim.along, self.aim.closed, self.search.size)

    @cached_property
    def ends(self) -> tuple[Floats, Floats]:
        """The way each word moves the coordinate, nan where it meets a pole, and its distance from closing, (N,)."""
        found = self.words.offsets(self.goal, self.lengths, loop_words.FEW)
        with np.errstate(invalid="ignore"):
            wild = ~(np.abs(found).max(axis=1) < FAR * self.search.size)
            amount = np.where(wild, np.nan, found[:, self.aim.along])
            amount[~(np.abs(amount) > CLEAR * self.search.size)] = np.nan
        return amount, np.abs(found[:, self.aim.closed]).max(axis=1, initial=0.0)

    def closing(self) -> Witness | None:
        """The simplest word that closes as it stands."""
        amount, miss = self.ends
        with np.errstate(invalid="ignore"):
            closing = np.isfinite(amount) & (miss < NEARLY * self.search.size)
        return self.first(self.lengths[closing], is_drawn=True)

    def solved(self) -> Witness | None:
        """A word that closes after its lengths are solved for."""
        amount, miss = self.ends
        with np.errstate(invalid="ignore"):
            near = np.flatnonzero(np.isfinite(amount) & (miss < NEAR_MISS * np.abs(amount)))
        near = near[np.argsort(miss[near] / np.abs(amount[near]), kind="stable")][:NEAR]
        if not near.size:
            return None
        subsets = _subsets(self.lengths.shape[1], self.extra)
        X = np.repeat(self.lengths[near], len(subsets), axis=0)
        varied = np.tile(subsets, (len(near), 1))
        return self.first(loop_words.solved(self.words, self.goal, X, varied), is_drawn=True)

    def shaped(self) -> Witness | None:
        """A word from lengths taken at random that closes and moves the coordinate by half the size."""
        return self._by_half(is_drawn=True)

    def free(self) -> Witness | None:
        """A path that closes and moves the coordinate by half the size."""
        return self._by_half(is_drawn=False)

    def _by_half(self, is_drawn: bool) -> Witness | None:
        goal = dataclasses.replace(self.goal, amount=self.search.size / 2)
        varied = np.ones(self.lengths.shape, dtype=bool)
        found = loop_words.solved(self.words, goal, self.lengths, varied, ENOUGH)
        return self.first(found, is_drawn)

    def first(self, X: Floats, is_drawn: bool) -> Witness | None:
        """The simplest of paths that close, if its proof holds."""
        if not len(X):
            return None
        size = self.search.size
        X = X[np.argsort(np.abs(X).sum(axis=1), kind="stable")[:SURVEYED]]
        rough, fine = (self.words.offsets(self.goal, X, n) for n in (loop_words.STEPS, loop_words.SURE))
        amount = fine[:, self.aim.along]
        with np.errstate(invalid="ignore"):
            # Near a pole the steps do not converge.
            smooth = np.abs(fine - rough).max(axis=1) < SMOOTH * size
            clear = np.flatnonzero((np.abs(amount) > CLEAR * size) & smooth)
        for number in sorted(clear, key=lambda i: _effort(self.words, X[i], float(amount[i]), size))[:3]:
            witness = self.search.proved(self.words, X[number], self.aim, is_drawn)
            if witness is not None:
                return witness
        return None


def _laid(
    frame: controlled_paths.ControlledFrame, base: Floats, controls: Floats
) -> tuple[Floats, Floats] | None:
    """Points of a path and the error of its end (k + 1,), from steps halved until nothing changes."""
    steps = SHOWN // 2
    points = controlled_paths.knots(frame, base, controls, steps)
    while steps < FINEST:
        steps *= 2
        finer = controlled_paths.knots(frame, base, controls, steps)
        if not np.isfinite(finer).all():
            return None
        changed = np.abs(finer[-1] - points[-1])
        points = finer
        if steps >= COARSEST and changed.max() > HOPELESS:
            return None
        if changed.max() <= EXACT * max(1.0, np.abs(points).max()):
            break
    return points, changed


def _row_residual(frame: controlled_paths.ControlledFrame, points: Floats, controls: Floats) -> float:
    """The largest |A_i dz| / (|A_i| |dz|) over rows and points."""
    steps = (len(points) - 1) // len(controls)
    before, U = points[:-1], np.repeat(controls, steps, axis=0)
    scale = frame.part.scale
    rates = controlled_paths.velocity(frame, before, U) * scale
    A = frame.part.forms(before) / scale
    sizes = np.linalg.norm(A, axis=2) * np.linalg.norm(rates, axis=1)[:, None]
    found = np.abs(np.einsum("ncz,nz->nc", A, rates)) / np.where(sizes > 0, sizes, 1.0)
    return float(found.max(initial=0.0))


def _free_names(frame: controlled_paths.ControlledFrame, names: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(names[i] for i in frame.free) if isinstance(frame, controlled_paths.Axes) else ()


def _effort(words: LoopWords, x: Floats, amount: float, size: float) -> tuple[float, ...]:
    """The effort of redoing a word by hand: its moves, an amount that is not round, lengths, an unclear amount."""
    controls = words.controls(x[None])[0]
    count = int((np.abs(controls).max(axis=1) > 0).sum())
    halves = 2 * abs(amount) / size
    is_round = abs(halves - round(halves)) < 1e-6
    is_faint = abs(amount) < 0.2 * size
    return (
        count,
        is_faint,
        not is_round,
        round(float(np.abs(controls).sum()), 6),
        abs(math.log(abs(amount) / size)),
    )


def _subsets(count: int, conditions: int) -> npt.NDArray[np.bool_]:
    """The lengths to solve for: each by itself where one condition is to be met, and all."""
    each = np.eye(count, dtype=bool) if conditions == 1 else np.zeros((0, count), dtype=bool)
    return np.concatenate([each, np.ones((1, count), dtype=bool)])


def _pivots(rows: Floats, first: int) -> Numbers:
    """Columns of rows (r, k) that are independent, `first` before all and then the largest, (r,)."""
    if np.linalg.norm(rows[:, first]) < LEAST_PIVOT:
        return np.zeros(0, dtype=np.int64)
    return np.array(
        independent_rows.farthest(rows.T, min(rows.shape), [first], least=LEAST_PIVOT), dtype=np.int64
    )
