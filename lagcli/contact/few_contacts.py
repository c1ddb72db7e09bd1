"""Few contacts at one instant whose rows stand well apart: the laws of `impact_law` by enumeration.

With D = G P G^T (k, k), P the inverse of M that equality rows leave, both laws ask for 0 <= z, D z + c >= 0, one of the
two zero for each contact. Of few contacts every set that may push is tried; D is positive definite, so that one answers
(Cottle, Pang and Stone, The Linear Complementarity Problem, section 3.3).
"""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np

from lagcli.contact.impact_law import SAFE, Exchange, LawResult, certified
from lagcli.contact.nonnegative import EPS, Floats
from lagcli.contact.single_contact import Response

# So many contacts are few. The smallest eigenvalue of D with ones on its diagonal is not below APART: what is solved
# with it keeps its digits.
MOST, APART = 4, 1e-2


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
        return bool(np.linalg.eigvalsh(self.D * scale * scale[:, None])[0] >= APART)

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
            for held in itertools.combinations(range(count), size):
                if (z := self._held(list(held), c)) is not None and (self.D @ z + c >= -rounding).all():
                    return z
        return None

    def _held(self, held: list[int], c: Floats) -> Floats | None:
        """z of contacts that are held; None where one of them pulls."""
        if len(held) == 1:
            part = -c[held] / self.D[held[0], held[0]]
        else:
            part = np.linalg.solve(self.D[np.ix_(held, held)], -c[held])
        if not (part > 0.0).all():
            return None
        z = np.zeros(c.size)
        z[held] = part
        return z

    def impact(self, v: Floats, speeds: Floats, e: Floats, terms: Floats) -> LawResult | None:
        """The impact of contacts with dg/dt = speeds (k,), sums of terms (k,), and coefficients e (k,).

        None where rounding decides. Raises `impact_law.EnergyCreated`.
        """
        c = speeds + e * np.minimum(speeds, 0.0)
        z = self.solve(c, SAFE * EPS * terms)
        if z is None:
            return None
        after = speeds + self.D @ z
        energy = certified(Exchange(speeds, after, terms), z)
        of_equalities = self.of_equalities(z)
        unique = np.ones(of_equalities.size + z.size, dtype=bool)
        return LawResult(self.moved(v, z), of_equalities, z, unique, after, energy)
