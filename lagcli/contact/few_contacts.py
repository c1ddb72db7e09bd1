"""Few contacts at one instant whose rows stand well apart: the laws of `impact_law` by enumeration.

With D = G P G^T (k, k), P the inverse of M that equality rows leave, both laws ask for 0 <= z, D z + c >= 0, one of the
two zero for each contact. Of one the answer is a formula, Lambda = -(1 + e) dot g- / D. Of few contacts every set that
may push is tried; D is positive definite, so that one answers (Cottle, Pang and Stone, The Linear Complementarity
Problem, section 3.3).
"""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np

from lagcli import doubles
from lagcli.contact import complementarity
from lagcli.contact.impact_law import Exchange, LawResult, certified, least_after
from lagcli.contact.least_distance import Floats


class FewContactParameters:
    """Limits of the formulas for few contacts; parts are of no unit.

    The tests are of `tests/unit/test_numbers_of_contacts.py` and `tests/unit/test_numbers_of_starts.py`.
    """

    __slots__ = ()

    most: int = 4
    """So many contacts are few. `test_four_contacts_are_few` fails at 0 and 40."""
    apart: float = 1e-2
    """The smallest eigenvalue of D with ones on its diagonal is not below this: what is solved with it keeps
    its digits. `test_few_contacts_are_apart_from_a_hundredth` fails at 0.001 and 0.1."""
    free: float = 0.01
    """Of the square of a row the equality rows leave this part at the least, or rounding is too large for a
    formula. `test_a_formula_serves_a_row_of_which_a_hundredth_is_left` fails at 0.001 and 0.1."""


PARAMETERS = FewContactParameters()


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Response:
    """The effect of an impulse 1 of a contact: velocities P G^T (n,), impulses of the equality rows (C,).

    square: G P G^T; free: G M^-1 G^T; left: what rounding leaves of the equality rows, as a part; terms: the sum of
    |G_i v_i| and |g_t| at the velocities at hand.
    """

    x: Floats
    of_equalities: Floats
    square: float
    free: float
    left: float
    terms: float

    @property
    def is_certain(self) -> bool:
        """True where the formula is as good as rounding."""
        return bool(
            0.0 < self.free < np.inf
            and self.square > PARAMETERS.free * self.free
            and self.left <= doubles.VALUE
        )


def single(v: Floats, speed: float, e: float, response: Response) -> LawResult | None:
    """The impact of one contact with dg/dt = speed and coefficient e; None where rounding is too large for a formula.

    Raises `EnergyCreated`.
    """
    if not response.is_certain:
        return None
    before = np.array([speed])
    asked = float(least_after(before, np.array([e]))[0])
    impulse = max(0.0, asked - speed) / response.square
    after = speed + impulse * response.square
    rounding = complementarity.PARAMETERS.safe * doubles.EPS * response.terms
    if not (after >= asked - rounding and (impulse == 0.0 or after <= asked + rounding)):
        return None
    speeds, impulses = np.array([after]), np.array([impulse])
    energy = certified(Exchange(before, speeds, np.array([response.terms])), impulses)
    of_equalities = impulse * response.of_equalities
    unique = np.ones(of_equalities.size + 1, dtype=bool)
    return LawResult(v + impulse * response.x, of_equalities, impulses, unique, speeds, energy)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class FewContacts:
    """The responses of contacts, and D."""

    responses: tuple[Response, ...]
    D: Floats

    @property
    def are_apart(self) -> bool:
        """True where formulas are as good as rounding."""
        if not all(response.is_certain for response in self.responses):
            return False
        if len(self.responses) == 1:
            return True
        scale = 1 / np.sqrt(np.diag(self.D))
        return bool(np.linalg.eigvalsh(self.D * scale * scale[:, None])[0] >= PARAMETERS.apart)

    @property
    def free(self) -> Floats:
        """G_i M^-1 G_i^T (k,)."""
        return np.array([response.free for response in self.responses])

    def moved(self, x: Floats, z: Floats) -> Floats:
        """Velocities or accelerations x (n,) after impulses or forces z (k,)."""
        for response, part in zip(self.responses, z.tolist(), strict=True):
            if part:
                x = x + part * response.x
        return x

    def of_equalities(self, z: Floats) -> Floats:
        """Impulses or forces of the equality rows (C,) beside those of the contacts, z (k,)."""
        return np.asarray(z @ np.array([response.of_equalities for response in self.responses]))

    def solve(self, c: Floats, rounding: Floats) -> Floats | None:
        """z (k,) with 0 <= z, D z + c >= -rounding and z_j = 0 or (D z + c)_j = 0; None where rounding decides."""
        count = c.size
        if (c >= -rounding).all():
            return np.zeros(count)
        for size in range(1, count + 1):
            for closed in itertools.combinations(range(count), size):
                if (z := self._closed(list(closed), c)) is not None and (self.D @ z + c >= -rounding).all():
                    return z
        return None

    def _closed(self, closed: list[int], c: Floats) -> Floats | None:
        """z of contacts that stay closed; None where one of them pulls."""
        if len(closed) == 1:
            part = -c[closed] / self.D[closed[0], closed[0]]
        else:
            part = np.linalg.solve(self.D[np.ix_(closed, closed)], -c[closed])
        if not (part > 0.0).all():
            return None
        z = np.zeros(c.size)
        z[closed] = part
        return z

    def impact(self, v: Floats, speeds: Floats, e: Floats, terms: Floats) -> LawResult | None:
        """The impact of contacts with dg/dt = speeds (k,), sums of terms (k,), and coefficients e (k,).

        None where rounding decides. Raises `impact_law.EnergyCreated`.
        """
        c = speeds - least_after(speeds, e)
        z = self.solve(c, complementarity.PARAMETERS.safe * doubles.EPS * terms)
        if z is None:
            return None
        after = speeds + self.D @ z
        energy = certified(Exchange(speeds, after, terms), z)
        of_equalities = self.of_equalities(z)
        unique = np.ones(of_equalities.size + z.size, dtype=bool)
        return LawResult(self.moved(v, z), of_equalities, z, unique, after, energy)
