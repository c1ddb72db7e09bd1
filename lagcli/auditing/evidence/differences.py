"""Derivatives and integrals of recorded columns, each with a bound on its own error.

Weights by Fornberg (Math. Comp. 51 (1988) 699) on the times as they are. Of stencils of several widths the one with
the least bound is taken, row by row: the truncation is the difference from the next narrower stencil, the largest
within a few rows; the noise is that of the column times the sum of the weights. No row is used beyond the table, so
that the ends have one-sided stencils and wider bounds.
"""

from __future__ import annotations

import functools
import itertools
import math
from typing import NamedTuple

import numpy as np

from lagcli import doubles
from lagcli.auditing.evidence.autodiff import Array

# How far an audit trusts what a row, a neighbour or a coarser formula says: the same in all checks.
WIDE = 4.0  # times what a coarser formula or the last digit leaves open: a limit
TWICE = 2.0  # times what rows show: there may be more between them
HALF = 0.5  # of some rows or numbers: most of them; and by how much a finer formula must be better
TENTH = 0.1  # of a quantity: what is less may vanish by chance, and decides nothing
# The tests of what follows are in `tests/unit/test_numbers_of_stencils.py`.
WIDTHS = (5, 7, 9, 11, 13)  # rows of a stencil: wider ones have less truncation and more noise
# Rows on either side of the widest one, of which an integral is exact with as many nodes
BESIDE = WIDTHS[-1] // 2
REACH = 4  # rows on either side within which a truncation counts
BLOCK = 64  # rows at a time
CAUTION = 8.0  # times the difference of two stencils: the limit
ONE_SIDED = 6.0  # times the limit where they do not stand around the row
# Of the differences of this order of rates: what the derivative of what they are the rates of may be off by at a kink.
# A jump J makes differences of 35 J and an error of J/2; a kink 20 and 1/10 of its change over a step, a jump of the
# curvature 10 and 1/30. At an end of the table the difference shows a jump once.
ROUGH, KINKED_END = 8, 1.5
CLOCK = 8 * doubles.EPS  # of the largest time: how well the times are known


class Estimate(NamedTuple):
    """A value (T, k) with the bounds of its noise and of its truncation, (T, k) each."""

    value: Array
    noise: Array
    truncation: Array

    @property
    def bound(self) -> Array:
        return self.noise + self.truncation


class DifferenceGrid:
    """The T times of a table, strictly increasing; clock: how well they are known, by default to their rounding."""

    def __init__(self, t: Array, clock: float | None = None) -> None:
        self.t = t
        self.clock = CLOCK * float(np.abs(t).max(initial=0.0)) if clock is None else clock
        self._steps = np.diff(t)

    @functools.cached_property
    def _stencils(self) -> list[tuple[Array, Array]]:
        """Indices (T, S) and weights (T, S) of d/dt, by width; narrower than the table."""
        stencils = []
        for width in WIDTHS:
            if width <= len(self.t):
                indices = _around(np.arange(len(self.t)) - width // 2, width, len(self.t))
                stencils.append((indices, weights_at_zero(self.t[indices] - self.t[:, None])[1]))
        return stencils

    def derivative(self, y: Array, noise: Array) -> Estimate:
        """d/dt of columns y (T, k) whose entries are known to `noise`, (k,) or (T, k)."""
        if len(self._stencils) < 2:
            nothing = np.zeros(y.shape)
            return Estimate(nothing, nothing, np.full(y.shape, np.inf))
        # The shorter of the steps at each row
        ends = np.concatenate([self._steps[:1], self._steps, self._steps[-1:]])
        clock = self.clock / np.minimum(ends[:-1], ends[1:])[:, None]
        best: Estimate | None = None
        narrower, before = combined(*self._stencils[0], y, about=True), np.zeros(y.shape)
        for indices, weights in self._stencils[1:]:
            slope = combined(indices, weights, y, about=True)
            now = np.abs(slope - narrower)
            wrong = CAUTION * widest(np.maximum(now, TENTH * before), REACH)
            wrong[indices[:, 0] != np.arange(len(y)) - indices.shape[1] // 2] *= ONE_SIDED
            sizes = np.abs(weights)
            total = sizes.sum(axis=1)[:, None]
            spread = total * noise if noise.ndim == 1 else combined(indices, sizes, noise)
            spread = spread + clock * np.abs(slope) + 4 * doubles.EPS * total * np.abs(y)
            wider = Estimate(slope, spread, wrong)
            if best is not None:
                keep = best.bound <= wider.bound
                wider = Estimate(*(np.where(keep, old, new) for old, new in zip(best, wider, strict=True)))
            best, narrower, before = wider, slope, now
        assert best is not None
        return best

    def resolved(self, y: Array, noise: Array) -> Array:
        """True where columns y (T, k) vary slowly enough for the spacing: wider stencils come closer together."""
        if len(self._stencils) < 3:
            return np.zeros(y.shape, dtype=bool)
        slopes, spread = [], np.zeros(y.shape)
        for indices, weights in self._stencils[-3:]:
            slopes.append(combined(indices, weights, y, about=True))
            spread = np.abs(weights).sum(axis=1)[:, None] * noise
        before, now = (widest(np.abs(b - a), REACH) for a, b in itertools.pairwise(slopes))
        small = np.maximum(doubles.ROOT * widest(np.abs(slopes[-1]), 2 * REACH), spread)
        return np.asarray((now <= HALF * before) | (np.maximum(now, before) <= small))

    def integral(self, y: Array, noise: Array) -> Estimate:
        """The integrals of columns y (T, k), known to `noise`, from the first row to each; the noise is that of sums.
        Where the spacing does not resolve them, at a kink or all along, the second differences around bound a step."""
        increments = wrong = np.zeros((len(self.t) - 1, y.shape[1]))
        if len(self.t) > 1:
            sums = [combined(indices, weights, y) for indices, weights in self._quadrature]
            increments = sums[0]
            wrong = np.maximum(np.abs(sums[0] - sums[1]), TENTH * np.abs(sums[1] - sums[2]))
            wrong = CAUTION * widest(wrong, REACH)
            first, width = self._quadrature[0][0][:, 0], self._quadrature[0][0].shape[1]
            wrong[first != np.arange(len(first)) - (width - 1) // 2] *= ONE_SIDED
            clear = self.resolved(y, noise)
            # Where y may have a kink or a jump within a step, the integral over it is bounded by second differences.
            unresolved = np.full(wrong.shape, np.inf)
            if len(self.t) >= 4:
                second = np.abs(scaled_differences(self.t, y, 2))
                ends = np.concatenate([second[:1], second, second[-1:]])
                unresolved = widest(np.maximum(ends[1:], ends[:-1]), 1) * self._steps[:, None]
            wrong = np.where(clear[1:] & clear[:-1], wrong, np.maximum(wrong, unresolved))
        begin = np.zeros((1, y.shape[1]))
        total = np.concatenate([begin, np.cumsum(increments, axis=0)])
        rounding = np.concatenate([begin, np.cumsum(np.abs(increments), axis=0)]) * 16 * doubles.EPS
        # Each time is an end of two steps: with an integrand that stays the same no more is left of the rounding of all
        # times than of the first and the last.
        ways = np.concatenate([begin, np.cumsum(np.abs(np.diff(y, axis=0)), axis=0)])
        clock = CLOCK * np.maximum(np.abs(y), np.abs(y[0])) + doubles.EPS * ways
        rounding = rounding + self.clock / CLOCK * clock
        return Estimate(total, rounding, np.concatenate([begin, np.cumsum(wrong, axis=0)]))

    def roughness(self, y: Array, rate: Array) -> Array:
        """The effect that a jump or a kink of the rates (T, k) may have on the derivative of columns y (T, k), (T, k).
        Across a kink two stencils agree by chance and both are wrong. Differences of high order show it, of y and of
        its rates alike; what one of them alone shows is an error of the table and excuses nothing."""
        order = min(ROUGH, len(self.t) - 3)
        if order < 2:
            return np.zeros(rate.shape)
        steps = np.lib.stride_tricks.sliding_window_view(self._steps, order + 1).max(axis=1)[:, None]
        ours = scaled_differences(self.t, y, order + 1) / steps
        theirs = scaled_differences(self.t, rate, order)
        largest = []  # within the stencils of each row
        for differences, half in ((ours, (order + 1) // 2), (theirs, order // 2)):
            weights = np.full(len(differences), TENTH)
            weights[:half] = weights[-half:] = KINKED_END
            centred = np.zeros(rate.shape)
            centred[half : half + len(differences)] = np.abs(differences) * weights[:, None]
            largest.append(widest(centred, BESIDE))
        return np.minimum(*largest)

    @functools.cached_property
    def _quadrature(self) -> list[tuple[Array, Array]]:
        """Indices and weights (T - 1, S) of the integral over each step, by three widths, the widest first."""
        widest = min(2 * BESIDE, len(self.t))
        widths = (widest, max(1, widest - 2), max(1, widest - 4))
        return [step_weights(self.t, width, BESIDE)[:2] for width in widths]


def step_weights(t: Array, width: int, count: int) -> tuple[Array, Array, Array]:
    """Indices (T - 1, S) of `width` rows around each step of times (T,), and the weights of the integrals over it of
    the polynomials y through them and of (h/2 - s) y, s from its beginning; count: nodes of the quadrature."""
    nodes, shares = np.polynomial.legendre.leggauss(count)
    h, indices = np.diff(t), _around(np.arange(len(t) - 1) - (width - 1) // 2, width, len(t))
    s = h * (1 + nodes[:, None]) / 2
    values = weights_at_zero((t[indices] - (t[:-1] + s)[:, :, None]).reshape(-1, width))[0]
    plain, moment = np.zeros(indices.shape), np.zeros(indices.shape)
    for share, offset, value in zip(shares, s, values.reshape(count, *indices.shape), strict=True):
        here = value * (share / 2 * h)[:, None]
        plain += here
        moment += here * (h / 2 - offset)[:, None]
    return indices, plain, moment


def _around(first: Array, width: int, rows: int) -> Array:
    """The numbers of `width` rows from the first on, of a table of so many, (M, width)."""
    return np.asarray(np.clip(first, 0, rows - width)[:, None] + np.arange(width))


def combined(indices: Array, weights: Array, y: Array, about: bool = False) -> Array:
    """sum_s weights[i, s] y[indices[i, s]] of columns y (T, k) for indices, which ascend, and weights (M, S): (M, k).
    In blocks; `about` a near row, where the weights add up to 0."""
    sums = np.empty((len(indices), y.shape[1]))
    for start in range(0, len(indices), BLOCK):
        rows = slice(start, start + BLOCK)
        taken = indices[rows]
        low, high = int(taken[:, 0].min()), int(taken[:, -1].max()) + 1
        band = np.zeros((len(taken), high - low))
        band.reshape(-1)[taken + (np.arange(len(taken)) * (high - low) - low)[:, None]] = weights[rows]
        near = y[low:high]
        sums[rows] = band @ (near - y[(low + high) // 2] if about else near)
    return sums


def scaled_differences(t: Array, y: Array, order: int) -> Array:
    """Differences (T - order, k) of columns y (T, k): of equal steps the usual ones, of others as the longest."""
    differences = y
    for k in range(1, order + 1):
        differences = (differences[1:] - differences[:-1]) / (t[k:] - t[:-k])[:, None]
    steps = np.lib.stride_tricks.sliding_window_view(np.diff(t), order).max(axis=1)
    return np.asarray(differences * (math.factorial(order) * steps**order)[:, None])


def widest(y: Array, reach: int = 2) -> Array:
    """The largest of each column within `reach` rows."""
    largest = y.copy()
    for k in range(1, min(reach, len(y) - 1) + 1):
        np.maximum(largest[k:], y[:-k], out=largest[k:])
        np.maximum(largest[:-k], y[k:], out=largest[:-k])
    return largest


def with_truncation(limit: Array, truncation: Array) -> Array:
    """A limit with what the spacing of rows leaves open, where that is known."""
    return np.asarray(limit + np.where(np.isfinite(truncation), truncation, 0.0))


def of_particles(size: Array) -> Array:
    """The largest size of the three components of each particle, (..., 3 K), in place of each of them."""
    by_particle = size.reshape(*size.shape[:-1], size.shape[-1] // 3, 3)
    return np.repeat(by_particle.max(axis=-1, initial=0.0), 3, axis=-1)


def weights_at_zero(x: Array) -> tuple[Array, Array]:
    """Weights (M, S) of the value and of the derivative at 0 of what is known at x (M, S)."""
    size = np.abs(x).max(axis=1)
    x = np.ascontiguousarray(x.T) / size
    value, slope = np.zeros(x.shape), np.zeros(x.shape)
    value[0] = 1.0
    before, now = np.ones(len(size)), x[0]
    for i in range(1, len(x)):
        last, now = now, x[i]
        gaps = now - x[:i]
        product = gaps[0]
        for gap in gaps[1:]:
            product = product * gap
        slope[i] = before * (value[i - 1] - last * slope[i - 1]) / product
        value[i] = -before * last * value[i - 1] / product
        slope[:i] = (now * slope[:i] - value[:i]) / gaps
        value[:i] = now * value[:i] / gaps
        before = product
    return np.ascontiguousarray(value.T), np.ascontiguousarray((slope / size).T)
