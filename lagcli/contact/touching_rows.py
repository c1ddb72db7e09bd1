"""Equality rows and contacts at one configuration, and the push that makes them do what is asked of them.

In the whitened metric (B~ = B M^-1/2) the push is u = B~^T mu_B + G~^T mu_G: the shortest with B~ u = c and G~ u >= d,
where contacts only push and only where G~ u = d. Impacts ask it of velocities, contact forces of accelerations.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from lagcli.contact import complementarity, load_sharing
from lagcli.contact.load_sharing import DEPENDENT, Flags
from lagcli.contact.nonnegative import Floats
from lagcli.linear.metric import Metric
from lagcli.linear.metric_rows import Sparse

# A contact of which the equality rows leave no more than this part cannot move: what is left is rounding.
HELD = 1e-7
# Each refinement gains all the digits there are; the second finds nothing but rounding.
REFINEMENTS = 2


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Push:
    """change: M^-1 (B^T equality + G^T contacts) (n,). equality (C,), contacts (k,) >= 0; unique (C + k,)."""

    change: Floats
    equality: Floats
    contacts: Floats
    unique: Flags


class TouchingRows:
    """Equality rows B (C, n) and contacts G (k, n) at one configuration, sparse; `metric` leaves no coordinate out.

    Nothing of size n x n is built; rows are dense here.
    """

    def __init__(self, metric: Metric, B: Sparse, G: Sparse) -> None:
        self.metric = metric
        self.B, self.G = np.array(B), np.array(G)
        white = np.vstack([np.array(metric.whitened(B)), np.array(metric.whitened(G))])
        lengths = np.linalg.norm(white, axis=1)
        self._lengths = np.where(lengths > 0, lengths, 1.0)
        self._unit = white / self._lengths[:, None]
        left, sigma, right = np.linalg.svd(self._unit[: self.held], full_matrices=False)
        kept = sigma > DEPENDENT
        self._left, self._sigma, self._right = left[:, kept], sigma[kept], right[kept]

    @property
    def held(self) -> int:
        """Equality rows, C."""
        return int(self.B.shape[0])

    @property
    def count(self) -> int:
        """Contacts, k."""
        return int(self.G.shape[0])

    def push(self, c: Floats, d: Floats, rounding: Floats) -> Push:
        """The push with B change = c (C,), G change >= d (k,) known to `rounding` (k,), and complementary.

        Impulses or forces that are not unique are split: the least sum of Lambda_i^2 |row_i M^-1/2|^2 over all rows
        together, contacts >= 0. Raises `ContradictoryRows` with the contacts that cannot all be obeyed, and
        `UndecidedRows`.
        """
        C, lengths = self.held, self._lengths
        c, d, rounding = c / lengths[:C], d / lengths[C:], rounding / lengths[C:]
        contacts = self._unit[C:]
        base = self._right.T @ ((self._left.T @ c) / self._sigma)
        bare = self._bare(contacts)
        found = complementarity.solve(bare, d - contacts @ base, rounding)
        mu = np.concatenate([np.zeros(C), found.multipliers])
        mu[:C] = self._weights(base - self._right.T @ (self._right @ (contacts.T @ mu[C:])))
        rows = np.concatenate([np.ones(C, dtype=bool), found.holds])
        unique = np.ones(rows.size, dtype=bool)
        mu[rows], unique[rows] = load_sharing.shared(self._unit[rows], mu[rows], C)
        mu = self._refined(mu, np.concatenate([c, d]))
        change = self.metric.unwhitened(self._unit.T @ mu)
        return Push(change, mu[:C] / lengths[:C], mu[C:] / lengths[C:], unique)

    def _bare(self, contacts: Floats) -> Floats:
        """The contacts (k, n) with the equality rows projected out; zero where nothing is left but rounding."""
        bare = contacts
        for _ in range(2):
            bare = bare - (bare @ self._right.T) @ self._right
        lengths = np.linalg.norm(bare, axis=1)
        return np.where((lengths > HELD)[:, None], bare, 0.0)

    def _weights(self, u: Floats) -> Floats:
        """The shortest weights (C,) of the equality rows with B~^T weights = u, of u in their span."""
        return np.asarray(self._left @ ((self._right @ u) / self._sigma))

    def _refined(self, mu: Floats, asked: Floats) -> Floats:
        """mu with the rows that hold met to rounding: what they are missing is asked for again."""
        rows = np.flatnonzero((mu > 0) | (np.arange(mu.size) < self.held))
        left, sigma, _ = np.linalg.svd(self._unit[rows], full_matrices=False)
        left = left[:, sigma > DEPENDENT] / sigma[sigma > DEPENDENT]
        mu = mu.copy()
        for _ in range(REFINEMENTS):
            missing = asked[rows] - self._unit[rows] @ (self._unit.T @ mu)
            mu[rows] += left @ (left.T @ missing)
        mu[self.held :] = np.maximum(mu[self.held :], 0.0)
        return mu
