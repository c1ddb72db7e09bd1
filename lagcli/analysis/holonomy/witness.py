"""The proof a teacher would draw that a row is not integrable: the simplest of the words of moves that close, as they
are or for other lengths, integrated again and verified.

Let tau be the direction of the orbit in which a coordinate moves and all that is free besides does not. If omega were
integrable, some phi with d phi = mu omega on the allowed displacements would stay constant on every path, while
omega(tau) != 0 makes it move along tau. So one loop with an amount beyond its error is the proof.
"""

from __future__ import annotations

import dataclasses
import math
from functools import cached_property

import numpy as np

from lagcli import doubles
from lagcli.analysis.holonomy import controlled_paths, loop_words
from lagcli.analysis.holonomy.loop_words import Goal, LoopWords
from lagcli.arrays import Floats

# In parts of the size of a loop: the least amount worth showing, the farthest that it may reach, and how much its end
# may change with finer steps, which near a pole do not converge; of the amount they move, what words may miss by.
CLEAR, FAR, SMOOTH, NEAR_MISS = 0.04, 25.0, 1e-4, 1.5


@dataclasses.dataclass(frozen=True)
class Path:
    """`corners` (S + 1, k + 1) are the ends of its moves, `points` (T, k + 1) lie along it."""

    corners: Floats
    points: Floats


@dataclasses.dataclass(frozen=True)
class Witness:
    """`coordinate` has moved by `amount`, known to `error`, and `back` have come back.

    One path is a closed loop with t fixed; of two the second is the one on which the coordinates rest, and the amount
    is the difference of their ends. `follow`: coordinates that constraints tie to the one that moved. `row_residual`:
    the largest |A dz| / (|A| |dz|) along the paths, `surface_residual` the largest |f|, `closure` the largest distance
    of a coordinate in `back` from where it should be. Each move changes one of `free`; a path of any shape has none.
    `is_shifted`: the base is not the declared start; `is_bent`: nor is the `configuration` (n,) of the whole system, of
    which what is not in `names` rests. `holds_time`: the rows depend on t, which a closed loop holds.
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
        """The index of a coordinate in the points."""
        return self.names.index(name)


def proved(words: LoopWords, goal: Goal, x: Floats) -> Witness | None:
    """The path integrated ever finer until its end stands, and everything about it measured; None if not so."""
    part = words.frame.part
    controls = words.controls(x[None])[0]
    paths = [controls[np.abs(controls).max(axis=1) > doubles.ZERO * goal.size]]
    if words.rest is not None:
        paths.append(words.rest)
    followed = [_followed(words.frame, goal.start, path) for path in paths]
    if any(one is None for one in followed):
        return None
    points = [one[0] for one in followed if one is not None]
    uncertain = np.sum([one[1] for one in followed if one is not None], axis=0)
    end = points[0][-1] - (points[1][-1] if len(points) > 1 else goal.start)
    amount = float(end[goal.along])
    closure = float(np.abs(end[goal.closed]).max(initial=0.0))
    moved = np.abs(end) > controlled_paths.SEEN * goal.size
    moved[[goal.along, *goal.closed]] = False
    # The largest |A_i dz| / (|A_i| |dz|) over rows and points
    residuals = []
    for passed, path in zip(points, paths, strict=True):
        before, U = passed[:-1], np.repeat(path, (len(passed) - 1) // len(path), axis=0)
        rates = controlled_paths.velocity(words.frame, before, U) * part.scale
        A = part.forms(before) / part.scale
        sizes = np.linalg.norm(A, axis=2) * np.linalg.norm(rates, axis=1)[:, None]
        rests = np.abs(np.einsum("ncz,nz->nc", A, rates)) / np.where(sizes > 0, sizes, 1.0)
        residuals.append(float(rests.max(initial=0.0)))
    size = float(max(np.abs(p).max() for p in points))
    error = float(uncertain[goal.along] + closure + 4 * doubles.EPS * size)
    clear = abs(amount) > CLEAR * goal.size and error < doubles.ROOT * abs(amount)
    if not (clear and max(residuals) < doubles.ZERO):
        return None
    if not moved.any():
        # The row keeps its sign along the coordinate between the two ends: then any integral changes. Where others
        # follow, the direction itself was tried at the base, and the amount is as small as one likes.
        Z = np.repeat(goal.start[None], 33, axis=0)
        Z[:, goal.along] += np.linspace(0, amount, 33)
        rate = part.forms(Z)[:, part.row, goal.along]
        if not (np.isfinite(rate).all() and ((rate > 0).all() or (rate < 0).all())):
            return None
    names = (*(part.system.model.coordinate_names[i] for i in part.coordinates), "t")
    scale = part.scale
    points = [p * scale for p in points]
    steps = [(len(p) - 1) // len(c) for p, c in zip(points, paths, strict=True)]
    return Witness(
        row=part.system.rows.rows[int(part.rows[part.row])].name,
        coordinate=names[goal.along],
        amount=amount * float(scale[goal.along]),
        error=error * float(scale[goal.along]),
        names=names,
        back=tuple(names[i] for i in np.flatnonzero(~moved[:-1]) if i != goal.along),
        follow=tuple(names[i] for i in np.flatnonzero(moved)),
        free=tuple(names[i] for i in words.frame.free),
        paths=tuple(  # of each move twelve points
            Path(p[::n], p[:: max(1, n // 12)]) for p, n in zip(points, steps, strict=True)
        ),
        row_residual=max(residuals),
        surface_residual=max(part.residual(p[:: max(1, len(p) // 100)] / scale) for p in points),
        closure=float(np.abs(end * scale)[goal.closed].max(initial=0.0)),
        is_shifted=False,
        is_bent=False,
        configuration=part.whole(goal.start[None])[0],
        holds_time=words.rest is None and part.knows_time,
    )


def _followed(
    frame: controlled_paths.ControlledFrame, base: Floats, controls: Floats
) -> tuple[Floats, Floats] | None:
    """Points of a path and the error of its end (k + 1,), from steps halved until nothing changes."""
    points = controlled_paths.knots(frame, base, controls, 6)
    for steps in (12, 24, 48, 96):
        finer = controlled_paths.knots(frame, base, controls, steps)
        if not np.isfinite(finer).all():
            return None
        changed = np.abs(finer[-1] - points[-1])
        points = finer
        if steps >= 48 and changed.max() > doubles.ROOT:
            return None
        if changed.max() <= doubles.VALUE * max(1.0, np.abs(points).max()):
            break
    return points, changed


@dataclasses.dataclass(frozen=True)
class LoopTrial:
    """Words of one kind with trial lengths (N, q), for one goal."""

    goal: Goal
    words: LoopWords
    lengths: Floats

    @property
    def extra(self) -> int:
        """The number of coordinates that must come back and do not do so by themselves."""
        return int(self.goal.closed.size - self.words.basis.shape[1])

    @cached_property
    def ends(self) -> tuple[Floats, Floats]:
        """The way each word moves the coordinate, nan where it meets a pole, and its distance from closing, (N,), by
        one step in each segment."""
        found = self.words.offsets(self.goal, self.lengths, 1)
        with np.errstate(invalid="ignore"):
            wild = ~(np.abs(found).max(axis=1) < FAR * self.goal.size)
            amount = np.where(wild, np.nan, found[:, self.goal.along])
            amount[~(np.abs(amount) > CLEAR * self.goal.size)] = np.nan
        return amount, np.abs(found[:, self.goal.closed]).max(axis=1, initial=0.0)

    def closing(self) -> Witness | None:
        """The simplest word that closes as it stands."""
        amount, miss = self.ends
        with np.errstate(invalid="ignore"):
            closing = np.isfinite(amount) & (miss < controlled_paths.SEEN * self.goal.size)
        return self.first(self.lengths[closing])

    def solved(self) -> Witness | None:
        """A word that closes after its lengths are solved for."""
        amount, miss = self.ends
        with np.errstate(invalid="ignore"):
            near = np.flatnonzero(np.isfinite(amount) & (miss < NEAR_MISS * np.abs(amount)))
        near = near[np.argsort(miss[near] / np.abs(amount[near]), kind="stable")][:8]
        if not near.size:
            return None
        # The lengths to solve for: each by itself where one condition is to be met, and all.
        count = self.lengths.shape[1]
        each = np.eye(count, dtype=bool) if self.extra == 1 else np.zeros((0, count), dtype=bool)
        subsets = np.concatenate([each, np.ones((1, count), dtype=bool)])
        X = np.repeat(self.lengths[near], len(subsets), axis=0)
        varied = np.tile(subsets, (len(near), 1))
        return self.first(loop_words.solved(self.words, self.goal, X, varied))

    def shaped(self) -> Witness | None:
        """The simpler of two paths from lengths taken at random that close and move the coordinate by half the size."""
        goal = dataclasses.replace(self.goal, amount=self.goal.size / 2)
        varied = np.ones(self.lengths.shape, dtype=bool)
        return self.first(loop_words.solved(self.words, goal, self.lengths, varied, enough=2))

    def first(self, X: Floats) -> Witness | None:
        """The simplest of paths that close, if its proof holds."""
        if not len(X):
            return None
        size = self.goal.size
        X = X[np.argsort(np.abs(X).sum(axis=1), kind="stable")[:200]]
        rough, fine = (self.words.offsets(self.goal, X, steps) for steps in (2, 12))
        amount = fine[:, self.goal.along]
        with np.errstate(invalid="ignore"):
            # Near a pole the steps do not converge.
            smooth = np.abs(fine - rough).max(axis=1) < SMOOTH * size
            clear = np.flatnonzero((np.abs(amount) > CLEAR * size) & smooth)
        for number in sorted(clear, key=lambda i: _effort(self.words, X[i], float(amount[i]), size))[:3]:
            found = proved(self.words, self.goal, X[number])
            if found is not None:
                return found
        return None


def _effort(words: LoopWords, x: Floats, amount: float, size: float) -> tuple[float, ...]:
    """The effort of redoing a word by hand: its moves, an amount that is not round, lengths, an unclear amount."""
    controls = words.controls(x[None])[0]
    count = int((np.abs(controls).max(axis=1) > 0).sum())
    halves = 2 * abs(amount) / size
    is_round = abs(halves - round(halves)) < 1e-6
    is_faint = abs(amount) < 0.2 * size
    length = round(float(np.abs(controls).sum()), 6)
    return count, is_faint, not is_round, length, abs(math.log(abs(amount) / size))
