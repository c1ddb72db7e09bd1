"""Ways to further zeros from one start: paths of a homotopy, and equations without the zeros that are known.

Newton's homotopy has the real paths F(x) = s F(x_0), which begin at a start with s = 1. A path is followed past s = 0:
it turns, comes back, and goes through further zeros, which nothing else may lead to (Keller, *Global homotopies and
Newton methods*, 1978; Allgower and Georg, *Numerical Continuation Methods*, 1990). Predictor and corrector: a step
along the tangent, then the shortest Newton steps back onto the path.

Deflation takes known zeros out of the equations (Farrell, Birkisson and Funke, SIAM J. Sci. Comput. 37 (2015) A2026):
the residual is multiplied by prod (1 + 1/d_i^2), d_i the distance of q to a known point: it is zero there no more.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

from lagcli.linear import decompositions
from lagcli.statics.rest_equations import RestEquations

Floats = npt.NDArray[np.float64]


class HomotopyParameters:
    """Numbers of Newton's homotopy; lengths are parts of the size of things.

    The tests are of `tests/unit/test_numbers_of_rest_searches.py`.
    """

    __slots__ = ()

    most_steps: int = 160
    """Steps of one way along a path. `test_a_path_has_a_hundred_and_sixty_steps` fails at 16 and 1600."""
    corrections: int = 4
    """Corrections of one step: more of them mean that it was too long. `test_a_step_is_corrected_four_times`
    fails at 0 and 40."""
    first: float = 0.05
    """The length of the first step. `test_a_path_that_asks_for_steps_of_a_hundred_thousandth_is_given_up`
    fails at 0.005 and 0.5."""
    longest: float = 0.3
    """The length of the longest step. `test_steps_along_a_path_grow_up_to_a_third` fails at 0.03 and 3."""
    shortest: float = 1e-5
    """A path that asks for shorter steps is given up.
    `test_a_path_that_asks_for_steps_of_a_hundred_thousandth_is_given_up` fails at 1e-6 and 0.0001."""
    off: float = 1e-7
    """What a corrected point may be off its path. `test_a_start_that_is_a_zero_has_no_path` fails at 1e-8 and
    1e-6."""
    far: float = 30.0
    """How far a path is followed. `test_a_path_is_followed_for_thirty_sizes` fails at 3 and 300."""
    bent: float = 0.7
    """Of two tangents the least cosine: a step that bends more may have come onto another path.
    `test_a_step_that_bends_much_is_made_shorter` fails at 0.07 and 7."""


class DeflationParameters:
    """Numbers of equations without known zeros; lengths are parts of the size of things.

    The tests are of `tests/unit/test_numbers_of_rest_searches.py`.
    """

    __slots__ = ()

    least: float = 1e-8
    """Distances below this are not divided by. `test_a_known_zero_is_not_divided_by_closer_than_eight_digits`
    fails at 1e-9 and 1e-7."""
    most_known: int = 60
    """Points that are taken out, the latest: each costs a gradient at every step.
    `test_the_latest_sixty_known_points_are_taken_out` fails at 6 and 600."""


PARAMETERS, DEFLATION = HomotopyParameters(), DeflationParameters()


def near_zeros(equations: RestEquations, x: Floats) -> Iterator[Floats]:
    """Points next to zeros of the equations, on both ways of the path through x.

    None where the equations are not as many as the unknowns, or x is a zero itself.
    """
    found = equations(x)
    if (
        found is None
        or found[1].shape[0] != found[1].shape[1]
        or not np.linalg.norm(found[0]) > PARAMETERS.off
    ):
        return
    path = _Path(equations, x, found)
    for sense in (1.0, -1.0):
        yield from path.followed(sense)


class _Path:
    """z = (x / units, s) with F(x) - s F(x_0) = 0."""

    def __init__(self, equations: RestEquations, x: Floats, found: tuple[Floats, Floats]) -> None:
        self._equations = equations
        self._first, J = found
        n = equations.problem.n
        widths = np.linalg.norm(J, axis=0)
        self._units = np.where(widths > 0, 1 / np.where(widths > 0, widths, 1.0), 1.0)
        self._units[:n] = equations.scales.length
        self._begin = np.append(x / self._units, 1.0)

    def followed(self, sense: float) -> Iterator[Floats]:
        """The points x at which s changes its sign along one way."""
        z = self._begin
        along = self._tangent(z)
        if along is None:
            return
        along, length = sense * along, PARAMETERS.first
        for _ in range(PARAMETERS.most_steps):
            there = self._corrected(z + length * along)
            turned = None if there is None else self._tangent(there)
            if there is None or turned is None or abs(turned @ along) < PARAMETERS.bent:
                length /= 3
                if length < PARAMETERS.shortest:
                    return
                continue
            turned *= np.sign(turned @ along)
            if (z[-1] > 0) != (there[-1] > 0):
                part = z[-1] / (z[-1] - there[-1])
                yield (z + part * (there - z))[:-1] * self._units
            z, along, length = there, turned, min(1.6 * length, PARAMETERS.longest)
            if np.abs(z).max() > PARAMETERS.far:
                return

    def _values(self, z: Floats) -> tuple[Floats, Floats] | None:
        found = self._equations(z[:-1] * self._units)
        if found is None:
            return None
        F, J = found
        return F - z[-1] * self._first, np.column_stack([J * self._units, -self._first])

    def _tangent(self, z: Floats) -> Floats | None:
        values = self._values(z)
        return None if values is None else decompositions.axes(values[1])[1][-1]

    def _corrected(self, z: Floats) -> Floats | None:
        for _ in range(PARAMETERS.corrections):
            values = self._values(z)
            if values is None:
                return None
            if np.linalg.norm(values[0]) <= PARAMETERS.off:
                return z
            z = z - decompositions.least_squares(values[1], values[0])
        values = self._values(z)
        return z if values is not None and np.linalg.norm(values[0]) <= PARAMETERS.off else None


class DeflatedEquations:
    """The residual of some equations without the zeros at `known` configurations; angles count by their sines."""

    def __init__(self, equations: RestEquations, known: Sequence[Floats], angles: Sequence[bool]) -> None:
        self._equations, self._known = equations, list(known)[-DEFLATION.most_known :]
        self._angles = np.array(angles, dtype=bool)

    def __call__(self, x: Floats) -> tuple[Floats, Floats] | None:
        """Residual and gradient."""
        found = self._equations(x)
        if found is None:
            return None
        r, J = found
        n, size = self._equations.problem.n, self._equations.scales.length
        factor, slope = 1.0, np.zeros(x.size)
        for q in self._known:
            way = (x[:n] - q) / size
            along = way / size
            half = (x[:n] - q)[self._angles] / 2
            way[self._angles], along[self._angles] = 2 * np.sin(half), np.sin(2 * half)
            square = max(float(way @ way), DEFLATION.least**2)
            factor *= 1 + 1 / square
            slope[:n] += -2 * along / square**2 / (1 + 1 / square)
        if not np.isfinite(factor):
            return None
        return factor * r, factor * (J + np.outer(r, slope))
