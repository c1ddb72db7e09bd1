"""A direction in the space of coordinates that belongs to no model: the same in every run, and on every machine."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

# The first signs of `default_rng(0).choice((-1.0, 1.0))`, written out: a model with few coordinates need not load
# `numpy.random`, which takes a twentieth of the time of its whole run.
_FIRST_SIGNS = "+++------+++++++++"


def direction(n: int, seed: int) -> Floats:
    """n numbers (n,) of mean square one that no model has: the parts of one in the squares of whole numbers, which
    begin by the seed, times the golden ratio (Weyl)."""
    k = np.arange(n, dtype=np.uint64) + np.uint64(1 + seed * 1_000_003)  # a prime lies between the seeds
    golden = np.uint64(0x9E3779B97F4A7C15)  # the part beyond one, of 2^64
    return np.asarray((k * k * golden).astype(np.int64) * (3**0.5 / 2**63))


def signs(n: int) -> Floats:
    """n times -1 or 1 (n,), the first that the generator with the seed 0 chooses."""
    if n <= len(_FIRST_SIGNS):
        return np.array([1.0 if sign == "+" else -1.0 for sign in _FIRST_SIGNS[:n]])
    return np.random.default_rng(0).choice((-1.0, 1.0), size=n)
