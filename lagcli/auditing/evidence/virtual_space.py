"""The space of virtual displacements at each row: what B leaves free (D.9), and what it does not."""

from __future__ import annotations

import copy

import numpy as np

from lagcli import doubles
from lagcli.auditing.evidence.autodiff import Array


class VirtualSpace:
    """The singular values and directions of B (M, C, n) at M rows, each row of it divided by its length.

    `rank` (M,); `usual`, the highest of them; `is_singular` (M,): rank lost or almost lost there, or B is not finite;
    `condition` (M,).
    """

    def __init__(self, B: Array) -> None:
        self._has_none: Array = np.asarray(~np.isfinite(B).all(axis=(1, 2)))
        self.B = B = np.where(self._has_none[:, None, None], 0.0, B)
        M, C, n = B.shape
        self.lengths = np.linalg.norm(B, axis=2)
        scaled = B / np.where(self.lengths > 0, self.lengths, 1.0)[:, :, None]
        least = min(C, n)
        self._left = np.zeros((M, C, least))
        self.sigma, self._across = np.zeros((M, least)), np.zeros((M, least, n))
        if least:
            self._left, self.sigma, self._across = np.linalg.svd(scaled, full_matrices=False)
        top = self.sigma.max(axis=1, initial=0.0)[:, None]
        self._independent = self.sigma > doubles.ZERO * top
        self._judge()

    def part(self, rows: slice) -> VirtualSpace:
        space = copy.copy(self)
        for name in ("B", "lengths", "sigma", "_left", "_across", "_independent", "_has_none"):
            setattr(space, name, getattr(self, name)[rows])
        space._judge()
        return space

    def _judge(self) -> None:
        M = len(self.sigma)
        top = self.sigma.max(axis=1, initial=0.0)[:, None]
        self.rank = self._independent.sum(axis=1)
        self.usual = int(self.rank.max(initial=0))
        smallest = self.sigma[:, self.usual - 1] if self.usual else np.ones(M)
        largest = top[:, 0] if self.usual else np.ones(M)
        self.is_singular = (smallest < doubles.ROOT * largest) | self._has_none
        with np.errstate(divide="ignore", invalid="ignore"):
            self._inverse = np.where(self._independent, 1 / self.sigma, 0.0)
            self.condition = largest / smallest
        shares = np.where(self._independent[:, None, :], self._left**2, 0.0).sum(axis=2)
        self.is_unique = (shares > 1 - 1e-6) & (self.lengths > 0)

    @property
    def are_apart(self) -> Array:
        """True for each of the M rows of a table where no row of B is near a combination of the others."""
        return np.asarray(self.sigma[:, -1] > doubles.ROOT * self.sigma[:, 0])

    def virtual(self, w: Array) -> Array:
        """The part of w (M, n) along virtual displacements: the sum over an orthonormal basis of (w . e) e."""
        along = np.where(self._independent, np.einsum("mkn,mn->mk", self._across, w), 0.0)
        return np.asarray(w - np.einsum("mkn,mk->mn", self._across, along))

    def step(self, f: Array) -> Array:
        """The shortest dq (M, n) with B dq = f (M, C)."""
        inverse = self._inverse
        with np.errstate(divide="ignore", invalid="ignore"):
            scaled = np.where(self.lengths > 0, f / self.lengths, 0.0)
        along = inverse * np.einsum("mck,mc->mk", self._left, scaled)
        return np.asarray(np.einsum("mkn,mk->mn", self._across, along))

    def basis(self, row: int) -> Array:
        """An orthonormal basis (n - rank, n) of the virtual displacements at one row."""
        n = self.B.shape[2]
        across = self._across[row][self._independent[row]]
        full = np.linalg.svd(across, full_matrices=True)[2] if len(across) else np.eye(n)
        return np.asarray(full[len(across) :])

    def multipliers(self, R: Array, limit: Array) -> tuple[Array, Array]:
        """lambda (M, C) whose forces come nearest to R (M, n), and how far they may be off where R is by `limit`."""
        inverse = self._inverse
        with np.errstate(divide="ignore", invalid="ignore"):
            along = inverse * np.einsum("mkn,mn->mk", self._across, R)
            lam = np.einsum("mck,mk->mc", self._left, along) / self.lengths
            spread = np.sqrt(np.einsum("mck,mk->mc", self._left**2, inverse**2)) / self.lengths
        return np.asarray(lam), np.asarray(spread * np.linalg.norm(limit, axis=1)[:, None])
