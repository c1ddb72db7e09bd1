"""Bounds of functions on a piece of a step, from values and slopes at its ends and a misfit measured inside.

On a piece of width w, with u in [0, 1] along it, a function lies between p(u) - 16 d u^2 (1 - u)^2 and
p(u) + 16 d u^2 (1 - u)^2: p is the cubic through the values and slopes of both ends (Hermite), which has exactly
this shape of error, and the doubt d the largest misfit in the piece. Both bounds have degree 4, and a polynomial lies
within its Bernstein coefficients and has at most as many roots as these change sign (Descartes). Of the five
coefficients d moves one, that in the middle, by 8 d / 3.
"""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Numbers = npt.NDArray[np.intp]

EPS = float(np.finfo(float).eps)
# The misfit of a piece that was cut is the doubt about its parts, this many times as large as a kink would leave.
SAFETY = 4.0
# The cubic is trusted to say how often a function leaves its side, and where the next value is worth most, if the
# doubt about it is this part of its range.
TRUSTED = 0.1
# After the first cut, the doubt is this part of what the cubics bend at the least.
WARY = 0.5
# A root of a cubic is found to rounding.
HALVINGS = 52


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Sample:
    """All functions at x: values g (K,) and slopes dg/dx (K,)."""

    x: float
    g: Floats
    slope: Floats


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """A piece of the step between two samples; the functions `rows` (k,) not yet decided on it, and the doubts (k,)."""

    left: Sample
    right: Sample
    rows: Numbers
    doubt: Floats

    @property
    def width(self) -> float:
        """Its part of the step."""
        return self.right.x - self.left.x

    def among(self, kept: Flags) -> Piece:
        """Some of the rows alone."""
        return dataclasses.replace(self, rows=self.rows[kept], doubt=self.doubt[kept])

    def ended(self, right: Sample) -> Piece:
        """Its part left of an inner sample, which told nothing new about the doubt."""
        return dataclasses.replace(self, right=right)

    def cut(self, inner: Sample, noise: Floats) -> tuple[Piece, Piece]:
        """Both parts. Their doubt is the misfit (A + B (u - c)) u^2 (1 - u)^2 of the cubic that the sample at c shows.

        noise: rounding of the functions (k,), which is no misfit.
        """
        a, b, r = self.left, self.right, self.rows
        w = self.width
        c = (inner.x - a.x) / w
        rise, m0, m1 = b.g[r] - a.g[r], w * a.slope[r], w * b.slope[r]
        value = a.g[r] + c * m0 + c * c * ((3 * rise - 2 * m0 - m1) + c * (m0 + m1 - 2 * rise))
        slope = m0 + c * (2 * (3 * rise - 2 * m0 - m1) + 3 * c * (m0 + m1 - 2 * rise))
        bell = (c * (1 - c)) ** 2
        misfit = np.abs(inner.g[r] - value) - _rounding(noise, a.g[r], rise, m0, m1)
        misfit = np.maximum(misfit, 0.0)
        turn = np.abs(w * inner.slope[r] - slope) - 2 * _rounding(noise, a.g[r], rise, m0, m1)
        turn = np.maximum(turn, 0.0) + misfit * abs(2 / c - 2 / (1 - c))
        doubt = SAFETY * (misfit + max(c, 1 - c) * turn) / (16 * bell)
        return (
            dataclasses.replace(self, right=inner, doubt=c * doubt),
            dataclasses.replace(self, left=inner, doubt=(1 - c) * doubt),
        )

    def wary(self) -> Piece:
        """The piece with no less doubt than a part of how much the cubics bend: one misfit may be small by chance."""
        bounds = self.bounds()
        bend = np.maximum(
            np.abs(bounds.b0 - 2 * bounds.b1 + bounds.b2), np.abs(bounds.b1 - 2 * bounds.b2 + bounds.b3)
        )
        return dataclasses.replace(self, doubt=np.maximum(self.doubt, WARY * bend))

    def bounds(self) -> Bounds:
        """Bounds of its rows."""
        a, b, r = self.left, self.right, self.rows
        third = self.width / 3
        return Bounds(a.g[r], a.g[r] + third * a.slope[r], b.g[r] - third * b.slope[r], b.g[r], self.doubt)


def _rounding(noise: Floats, *terms: Floats) -> Floats:
    return np.asarray(3 * noise + 8 * EPS * functools.reduce(np.maximum, (np.abs(term) for term in terms)))


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Bounds:
    """The cubics of k functions by their Bernstein coefficients, each (k,), and the doubts about them."""

    b0: Floats
    b1: Floats
    b2: Floats
    b3: Floats
    doubt: Floats

    def _outer(self) -> tuple[Floats, Floats, Floats, Floats]:
        return self.b0, (self.b0 + 3 * self.b1) / 4, (3 * self.b2 + self.b3) / 4, self.b3

    def extent(self) -> tuple[Floats, Floats]:
        """Below and above which no function goes; not a number where nothing can be said."""
        outer, middle, reach = self._outer(), (self.b1 + self.b2) / 2, 8 / 3 * self.doubt
        low = functools.reduce(np.minimum, (*outer, middle - reach))
        return low, functools.reduce(np.maximum, (*outer, middle + reach))

    def rounding(self) -> Floats:
        """Of the coefficients themselves."""
        return np.asarray(4 * EPS * np.maximum(np.abs(self.b1), np.abs(self.b2)))

    def turns_once(self, is_up: Flags) -> Flags:
        """Functions that leave their side, the upper one or the lower one, and do so at one place alone.

        One that begins at zero, rounding on the wrong side of it, is taken to begin on its side.
        """
        sign = np.where(is_up, 1.0, -1.0)
        level = np.minimum(sign * self.b0, 0.0)
        c0, c1, c3, c4 = (sign * c - level for c in self._outer())
        middle, reach = sign * (self.b1 + self.b2) / 2 - level, 8 / 3 * self.doubt
        extent = np.maximum(np.maximum(c0, c1), np.maximum(middle, c3)) - c4
        once = self.doubt <= TRUSTED * extent
        for c2 in (middle - reach, middle + reach):
            signs = np.array([c0 >= 0, c1 > 0, c2 > 0, c3 > 0, c4 > 0])
            once &= np.count_nonzero(signs[1:] != signs[:-1], axis=0) == 1
        return once

    def fall(self, row: int) -> float:
        """The place in the piece, in [0, 1], at which the cubic of a function that falls to below zero once does so."""
        b0, b1, b2, b3 = (float(b[row]) for b in (self.b0, self.b1, self.b2, self.b3))
        level = min(b0, 0.0)
        low, high = 0.0, 1.0
        for _ in range(HALVINGS):
            u = (low + high) / 2
            v = 1 - u
            above = v * v * (v * b0 + 3 * u * b1) + u * u * (3 * v * b2 + u * b3) > level
            low, high = (u, high) if above else (low, u)
        return (low + high) / 2

    def lowest(self, is_up: Flags) -> float | None:
        """The place in the piece, in (0, 1), at which the function that comes nearest to leaving its side turns back;
        None where that cannot be told."""
        sign = np.where(is_up, 1.0, -1.0)
        b = [sign * c for c in (self.b0, self.b1, self.b2, self.b3)]
        low, high = functools.reduce(np.minimum, b), functools.reduce(np.maximum, b)
        fits = np.flatnonzero(self.doubt <= TRUSTED * (high - low))
        if not fits.size:
            return None
        row = fits[np.argmin(low[fits] / (high - low)[fits])]
        d0, d1, d2 = (float((b[i + 1] - b[i])[row]) for i in range(3))
        # The slope is d0 + 2 turn u + bend u^2; it rises at the root that is the lowest place.
        turn, bend, root = d1 - d0, d0 - 2 * d1 + d2, d1 * d1 - d0 * d2
        if not root > 0 or (turn <= 0 and bend <= 0):
            return None
        root = root**0.5
        u = -d0 / (turn + root) if turn > 0 else (root - turn) / bend
        return u if 0 < u < 1 else None
