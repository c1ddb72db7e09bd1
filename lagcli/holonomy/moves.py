"""Words of moves: which paths are tried, and how their lengths are solved for.

Without time a word turns two free coordinates in turn, a b a b ..., and comes back in both: a rectangle, or a
chain of them. In time each segment takes the time dt, the free coordinates go forth and back, and the end is
compared with that of a path on which they rest.
"""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import numpy.typing as npt

from lagcli.holonomy import flow

Floats = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]

FEW, STEPS, SURE = (
    1,
    2,
    6,
)  # of the scheme in each segment: to choose a word, to solve for its lengths, to end
COARSE, CLOSED = 1e-9, 1e-13
ITERATIONS, POLISH, NUDGE = 12, 4, 1e-4
CONTRACTS, FREE_TURNS = (
    0.7,
    3,
)  # a start that misses by more of what it missed before, after some turns, is left
STARTS = 4
AT_RANDOM = 200  # trials where all combinations would be too many
HALVES = (1.0, 2.0, -1.0, -2.0)


@dataclasses.dataclass(frozen=True)
class Goal:
    """The coordinate that shall move, `along`, those that shall come back (e,), and the start (k + 1,).

    `amount`: what it shall move by, if that is asked for.
    """

    start: Floats
    along: int
    closed: Numbers
    size: float
    amount: float | None = None


@dataclasses.dataclass(frozen=True)
class Words:
    """Paths of one kind: `basis` (S, m, q) makes controls of the lengths x (q,); `fixed` (S, m) is added.

    `rest`: the controls of the path they are compared with, or None for closed loops.
    """

    frame: flow.Frame
    basis: Floats
    fixed: Floats
    rest: Floats | None = None

    def controls(self, X: Floats) -> Floats:
        """Controls (N, S, m) for lengths X (N, q)."""
        return np.asarray(np.einsum("smq,nq->nsm", self.basis, X) + self.fixed)

    def offsets(self, goal: Goal, X: Floats, steps: int) -> Floats:
        """Where paths end, relative to the start or to the path of rest, (N, k + 1)."""
        ends = flow.ends(self.frame, goal.start, self.controls(X), steps)
        if self.rest is None:
            return np.asarray(ends - goal.start)
        return np.asarray(ends - flow.ends(self.frame, goal.start, self.rest[None], steps))


def loops(
    frame: flow.Frame, m: int, pair: tuple[int, int], units: Floats, extra: int
) -> tuple[Words, Floats]:
    """Words a b a b ... in two of m free coordinates, with trial lengths (N, q), for `extra` conditions."""
    letters = (2 + extra) * 2 + 1
    first, second = pair
    count_a, count_b = (letters + 1) // 2, letters // 2
    basis = np.zeros((letters, m, count_a + count_b - 2))
    for place in range(letters):
        which, number, count = (
            (first, place // 2, count_a) if place % 2 == 0 else (second, place // 2, count_b)
        )
        offset = 0 if place % 2 == 0 else count_a - 1
        if number < count - 1:
            basis[place, which, offset + number] = 1.0
        else:
            basis[place, which, offset : offset + count - 1] = -1.0
    values = [(0.0, *HALVES), *[(*HALVES, 4.0, -4.0)] * (count_a - 2)]
    others = [(1.0,), *[(0.0, *HALVES)] * (count_b - 2)]
    if extra > 1:  # all combinations would be too many
        random = np.random.default_rng(letters)
        grid = np.array([[random.choice(v) for v in (*values, *others)] for _ in range(AT_RANDOM)])
    else:
        grid = np.array(list(itertools.product(*values, *others)))
    scale = np.concatenate([np.full(count_a - 1, units[first]), np.full(count_b - 1, units[second])])
    return Words(frame, basis, np.zeros((letters, m))), grid * scale


def journeys(frame: flow.Frame, m: int, axis: int, units: Floats, extra: int) -> tuple[Words, Floats]:
    """Words in time: one free coordinate forth and back, the last of the m controls being dt."""
    letters = 2 + 2 * extra
    basis = np.zeros((letters, m, letters - 1))
    basis[:-1, axis] = np.eye(letters - 1)
    basis[-1, axis] = -1.0
    fixed = np.zeros((letters, m))
    fixed[:, -1] = units[-1]
    values = [HALVES, *[(0.0, *HALVES)] * (letters - 2)]
    if extra > 1:
        random = np.random.default_rng(letters)
        grid = np.array([[random.choice(v) for v in values] for _ in range(AT_RANDOM)])
    else:
        grid = np.array(list(itertools.product(*values)))
    return Words(frame, basis, fixed, fixed), grid * units[axis]


def free_paths(frame: flow.Projected, size: float, timed: bool, segments: int) -> tuple[Words, Floats]:
    """Paths of any shape: random controls (N, q) in some segments, to be solved for."""
    m = frame.directions.shape[1]
    random = np.random.default_rng(segments)
    count = segments * m
    basis = np.zeros((segments, m + 1, count))
    basis[:, :m] = np.eye(count).reshape(segments, m, count)
    fixed = np.zeros((segments, m + 1))
    fixed[:, -1] = size if timed else 0.0
    lengths = size * random.standard_normal((STARTS, count)) / np.sqrt(m)
    return Words(frame, basis, fixed, fixed if timed else None), lengths


def solved(words: Words, goal: Goal, X: Floats, varied: Flags) -> Floats:
    """Lengths (K, q), K <= M, of paths that close, by Gauss-Newton from X (M, q) on the lengths `varied` (M, q).

    Starts that do not contract are left.
    """
    done: list[tuple[Floats, Flags]] = []
    for steps, iterations in ((STEPS, ITERATIONS), (SURE, POLISH)):
        close = COARSE if steps == STEPS else CLOSED
        done, last = [], np.full(len(X), np.inf)
        kept = varied
        for turn in range(iterations):
            miss, J = _missed(words, goal, X, steps)
            worst = np.abs(miss).max(axis=1, initial=0.0)
            there = worst <= close * goal.size
            done += [(x, v) for x, v in zip(X[there], kept[there], strict=True)]
            with np.errstate(invalid="ignore"):
                on = ~there & np.isfinite(worst) & np.isfinite(J).all(axis=(1, 2))
                on &= (worst < CONTRACTS * last) | (turn < FREE_TURNS)
            if not on.any():
                break
            X, kept, last = X[on], kept[on], worst[on]
            inverse = np.linalg.pinv(J[on] * kept[:, None, :], rcond=1e-6)
            step = -np.einsum("nqe,ne->nq", inverse, miss[on])
            largest = np.abs(step).max(axis=1, initial=1e-300)
            X = X + step * np.minimum(1.0, goal.size / largest)[:, None]
        if not done:
            return np.zeros((0, varied.shape[1]))
        X, varied = np.array([x for x, _ in done]), np.array([v for _, v in done])
    return X


def _missed(words: Words, goal: Goal, X: Floats, steps: int) -> tuple[Floats, Floats]:
    """What paths miss, (M, e), and its derivatives by their lengths, (M, e, q)."""
    asked, wanted = goal.closed, np.zeros(goal.closed.size)
    if goal.amount is not None:
        asked, wanted = np.append(asked, goal.along), np.append(wanted, goal.amount)
    M, q = X.shape
    nudge = NUDGE * goal.size
    shifts = np.concatenate([np.zeros((1, q)), nudge * np.eye(q), -nudge * np.eye(q)])
    trials = (X[:, None, :] + shifts).reshape(-1, q)
    found = words.offsets(goal, trials, steps)[:, asked].reshape(M, 2 * q + 1, asked.size)
    J = (found[:, 1 : q + 1] - found[:, q + 1 :]) / (2 * nudge)
    return found[:, 0] - wanted, J.transpose(0, 2, 1)
