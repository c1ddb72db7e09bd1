"""Words of moves: which paths are tried, and how their lengths are solved for.

Without time a word turns two free coordinates in turn, a b a b ..., and comes back in both: a rectangle, or a
chain of them. In time each segment takes the time dt, the free coordinates go forth and back, and the end is
compared with that of a path on which they rest.
"""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np

from lagcli import doubles
from lagcli.analysis.holonomy import controlled_paths
from lagcli.arrays import Flags, Floats, Integers
from lagcli.linear import rank

# Lengths of trials, in units of the coordinates.
HALVES = (1, 2, -1, -2)
# A start that misses by more of what it missed before is left.
CONTRACTS = 0.7


@dataclasses.dataclass(frozen=True)
class Goal:
    """The coordinate that shall move, `along`, those that shall come back (e,), and the start (k + 1,).

    `amount`: what it shall move by, if that is asked for.
    """

    start: Floats
    along: int
    closed: Integers
    size: float
    amount: float | None = None


@dataclasses.dataclass(frozen=True)
class LoopWords:
    """Paths of one kind: `basis` (S, m, q) makes controls of the lengths x (q,); `fixed` (S, m) is added.

    `rest`: the controls of the path they are compared with, or None for closed loops.
    """

    frame: controlled_paths.ControlledFrame
    basis: Floats
    fixed: Floats
    rest: Floats | None = None

    def controls(self, X: Floats) -> Floats:
        """Controls (N, S, m) for lengths X (N, q)."""
        return np.asarray(np.einsum("smq,nq->nsm", self.basis, X) + self.fixed)

    def offsets(self, goal: Goal, X: Floats, steps: int) -> Floats:
        """The ends of paths, relative to the start or to the path of rest, (N, k + 1)."""
        ends = controlled_paths.ends(self.frame, goal.start, self.controls(X), steps)
        return np.asarray(ends - self.resting(goal, steps))

    def resting(self, goal: Goal, steps: int) -> Floats:
        """The end (k + 1,) of what paths are compared with."""
        if self.rest is None:
            return goal.start
        return np.asarray(controlled_paths.ends(self.frame, goal.start, self.rest[None], steps)[0])


def loops(
    frame: controlled_paths.ControlledFrame, m: int, pair: tuple[int, int], units: Floats, extra: int
) -> tuple[LoopWords, Floats]:
    """Words a b a b ... in two of m free coordinates, with trial lengths (N, q), for `extra` conditions."""
    letters = (2 + extra) * 2 + 1
    first, second = pair
    count_a, count_b = (letters + 1) // 2, letters // 2
    basis = np.zeros((letters, m, letters - 2))
    # The last move along each coordinate takes back all others.
    own, other = (np.vstack([np.eye(count - 1), -np.ones(count - 1)]) for count in (count_a, count_b))
    basis[::2, first, : count_a - 1] = own
    basis[1::2, second, count_a - 1 :] = other
    scale = np.concatenate([np.full(count_a - 1, units[first]), np.full(count_b - 1, units[second])])
    values = [(0, *HALVES), *[(*HALVES, 4, -4)] * (count_a - 2), (1,), *[(0, *HALVES)] * (count_b - 2)]
    return LoopWords(frame, basis, np.zeros((letters, m))), _lengths(values, letters, extra) * scale


def words_in_time(
    frame: controlled_paths.ControlledFrame, m: int, axis: int, units: Floats, extra: int
) -> tuple[LoopWords, Floats]:
    """Words in time: one free coordinate forth and back, the last of the m controls being dt."""
    letters = 2 + 2 * extra
    basis = np.zeros((letters, m, letters - 1))
    basis[:-1, axis] = np.eye(letters - 1)
    basis[-1, axis] = -1.0
    fixed = np.zeros((letters, m))
    fixed[:, -1] = units[-1]
    values = [HALVES, *[(0, *HALVES)] * (letters - 2)]
    return LoopWords(frame, basis, fixed, fixed), _lengths(values, letters, extra) * units[axis]


def _lengths(values: list[tuple[int, ...]], letters: int, extra: int) -> Floats:
    """All combinations (N, q) of round lengths; where they would be too many twelve at random."""
    if extra > 1:
        return np.random.default_rng(letters).standard_normal((12, len(values)))
    return np.array(list(itertools.product(*values)), dtype=float)


def free_paths(
    frame: controlled_paths.ControlledFrame, size: float, timed: bool, segments: int
) -> tuple[LoopWords, Floats]:
    """Paths of any shape: four random controls (N, q) in some segments, to be solved for."""
    m = frame.controls.shape[1] - 1
    random = np.random.default_rng(segments)
    count = segments * m
    basis = np.zeros((segments, m + 1, count))
    basis[:, :m] = np.eye(count).reshape(segments, m, count)
    fixed = np.zeros((segments, m + 1))
    fixed[:, -1] = size if timed else 0.0
    lengths = size * random.standard_normal((4, count)) / np.sqrt(m)
    return LoopWords(frame, basis, fixed, fixed if timed else None), lengths


def solved(words: LoopWords, goal: Goal, X: Floats, varied: Flags, enough: int | None = None) -> Floats:
    """Lengths (K, q), K <= M, of paths that close, by Gauss-Newton from X (M, q) on the lengths `varied` (M, q). Rough
    paths, of two steps in each segment, come near with their derivatives, then those serve fine paths, of twelve.
    Starts that do not contract are left, and all others once `enough` are there."""
    near: list[tuple[Floats, Floats]] = []
    last = np.full(len(X), np.inf)
    wanted = np.append(np.zeros(goal.closed.size), [] if goal.amount is None else goal.amount)
    for turn in range(16):
        ends, J = controlled_paths.turned(words.frame, goal.start, words.controls(X), words.basis, 2)
        miss, J = _asked(goal, ends - words.resting(goal, 2)) - wanted, _asked(goal, J)
        worst = np.abs(miss).max(axis=1, initial=0.0)
        with np.errstate(invalid="ignore"):
            on = np.isfinite(worst) & np.isfinite(J).all(axis=(1, 2))
            on &= (worst < CONTRACTS * last) | (turn < 3)  # at first it may rise
            there = on & (worst <= controlled_paths.SEEN * goal.size)
        X, J, miss, varied, last, there = (x[on] for x in (X, J, miss, varied, worst, there))
        if not on.any():
            break
        inverse = rank.pseudo_inverse(J * varied[:, None, :])
        near += [(x, turned) for x, turned in zip(X[there], inverse[there], strict=True)]
        if there.all() or (enough is not None and len(near) >= enough):
            break
        step = -np.einsum("nqe,ne->nq", inverse, miss)
        largest = np.abs(step).max(axis=1, initial=1e-300)
        X = (X + step * np.minimum(1.0, goal.size / largest)[:, None])[~there]
        varied, last = varied[~there], last[~there]
    # Lengths of fine paths that close, from those of rough ones with the inverse of their derivatives (q, e)
    done: list[Floats] = []
    if not near:
        return np.zeros((0, words.basis.shape[2]))
    X, inverse = (np.array(each) for each in zip(*near, strict=True))
    last = np.full(len(X), np.inf)
    rest = words.resting(goal, 12)
    for _ in range(10):
        ends = controlled_paths.ends(words.frame, goal.start, words.controls(X), 12)
        miss = _asked(goal, ends - rest) - wanted
        worst = np.abs(miss).max(axis=1, initial=0.0)
        there = worst <= doubles.VALUE * goal.size
        done += list(X[there])
        with np.errstate(invalid="ignore"):
            on = ~there & (worst < CONTRACTS * last)
        if not on.any():
            break
        X, inverse, last = X[on], inverse[on], worst[on]
        X = X - np.einsum("nqe,ne->nq", inverse, miss[on])
    return np.array(done).reshape(-1, words.basis.shape[2])


def _asked(goal: Goal, found: Floats) -> Floats:
    """The part of ends (N, k + 1, ...) that the goal asks about: (N, e, ...)."""
    return found[:, goal.closed if goal.amount is None else np.append(goal.closed, goal.along)]
