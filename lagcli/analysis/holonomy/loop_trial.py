"""A trial of words of moves: those that close as they are, or for other lengths; the simplest of them is taken."""

from __future__ import annotations

import dataclasses
import math
from functools import cached_property

import numpy as np
import numpy.typing as npt

from lagcli.analysis.holonomy import loop_words, witness
from lagcli.analysis.holonomy.loop_words import Goal, LoopWords
from lagcli.analysis.holonomy.witness import Witness

Floats = npt.NDArray[np.float64]


class TrialParameters:
    """The choice among words; sizes are parts of that of a loop.

    The tests are of `tests/unit/test_numbers_of_flags_and_loops.py`.
    """

    __slots__ = ()

    far: float = 25.0
    """The farthest that a loop may reach. `test_a_loop_reaches_twenty_five_sizes_at_most` fails at 2.5 and
    250."""
    near: int = 8
    """Words whose lengths are solved for. `test_the_lengths_of_eight_words_are_solved_for` fails at 0 and
    80."""
    near_miss: float = 1.5
    """The most that they miss by, of the amount they move.
    `test_words_that_miss_by_what_they_move_are_solved_for` fails at 0.15 and 15."""
    sampled: int = 200
    """Closed paths that are looked at. `test_two_hundred_closed_paths_are_looked_at` fails at 20 and 2000."""
    smooth: float = 1e-4
    """The change of their ends with finer steps that is allowed: near a pole the steps do not converge.
    `test_the_end_of_a_path_stays_with_finer_steps` fails at 1e-5 and 0.001."""
    enough: int = 2
    """Solutions among which the simplest is taken, of starts taken at random.
    `test_the_simplest_of_two_shapes_is_taken` fails at 0 and 20."""


PARAMETERS = TrialParameters()


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
        """The way each word moves the coordinate, nan where it meets a pole, and its distance from closing, (N,)."""
        found = self.words.offsets(self.goal, self.lengths, loop_words.PARAMETERS.few)
        with np.errstate(invalid="ignore"):
            wild = ~(np.abs(found).max(axis=1) < PARAMETERS.far * self.goal.size)
            amount = np.where(wild, np.nan, found[:, self.goal.along])
            amount[~(np.abs(amount) > witness.PARAMETERS.clear * self.goal.size)] = np.nan
        return amount, np.abs(found[:, self.goal.closed]).max(axis=1, initial=0.0)

    def closing(self) -> Witness | None:
        """The simplest word that closes as it stands."""
        amount, miss = self.ends
        with np.errstate(invalid="ignore"):
            closing = np.isfinite(amount) & (miss < loop_words.PARAMETERS.coarse * self.goal.size)
        return self.first(self.lengths[closing], is_drawn=True)

    def solved(self) -> Witness | None:
        """A word that closes after its lengths are solved for."""
        amount, miss = self.ends
        with np.errstate(invalid="ignore"):
            near = np.flatnonzero(np.isfinite(amount) & (miss < PARAMETERS.near_miss * np.abs(amount)))
        near = near[np.argsort(miss[near] / np.abs(amount[near]), kind="stable")][: PARAMETERS.near]
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
        goal = dataclasses.replace(self.goal, amount=self.goal.size / 2)
        varied = np.ones(self.lengths.shape, dtype=bool)
        found = loop_words.solved(self.words, goal, self.lengths, varied, PARAMETERS.enough)
        return self.first(found, is_drawn)

    def first(self, X: Floats, is_drawn: bool) -> Witness | None:
        """The simplest of paths that close, if its proof holds."""
        if not len(X):
            return None
        size = self.goal.size
        X = X[np.argsort(np.abs(X).sum(axis=1), kind="stable")[: PARAMETERS.sampled]]
        rough, fine = (
            self.words.offsets(self.goal, X, n)
            for n in (loop_words.PARAMETERS.steps, loop_words.PARAMETERS.sure)
        )
        amount = fine[:, self.goal.along]
        with np.errstate(invalid="ignore"):
            # Near a pole the steps do not converge.
            smooth = np.abs(fine - rough).max(axis=1) < PARAMETERS.smooth * size
            clear = np.flatnonzero((np.abs(amount) > witness.PARAMETERS.clear * size) & smooth)
        for number in sorted(clear, key=lambda i: _effort(self.words, X[i], float(amount[i]), size))[:3]:
            found = witness.proved(self.words, self.goal, X[number], is_drawn)
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
