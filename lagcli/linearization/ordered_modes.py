"""Frequencies and shapes in their order, each shape as one reads it: largest entry 1, no rounding beside zero."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lagcli.linearization.spectrum import Spectrum

Floats = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

# Entries of a shape that are this small are none; those this near to the largest are as large.
NOTHING, EQUAL, ROUNDED = 1e-11, 1e-9, 1e-13
# Frequencies that differ by this part belong to one space of shapes.
TOGETHER = 1e-9


def eigenvalues(found: Spectrum) -> Complex:
    """All eigenvalues, zeros first, then by imaginary and real parts, conjugates side by side."""
    order = _order(found.values)
    return np.concatenate([np.zeros(found.zeros, dtype=complex), found.values[order]])


def _order(values: Complex) -> list[int]:
    size = float(np.abs(values).max(initial=0.0)) or 1.0
    near = np.round(values / size, 12)
    return sorted(range(values.size), key=lambda i: (abs(near[i].imag), near[i].real, -near[i].imag))


def frequencies(found: Spectrum) -> Floats | None:
    """Angular frequencies, ascending, one for each freedom of positions; None where some eigenvalue has a real part."""
    if found.values.real.any():
        return None
    positive = np.sort(found.values.imag[found.values.imag > 0])
    return np.concatenate([np.zeros(max(0, found.freedoms - positive.size)), positive])


def shapes(found: Spectrum) -> Complex:
    """Shapes (j, n): where there are frequencies in their order, else of all eigenvalues in theirs."""
    n, values = found.shapes.shape[0], found.values
    if values.real.any():
        still = tidy_basis(_independent(found.still).T.astype(complex))
        # A displacement and a drift along it are two zero eigenvalues with one shape.
        zeros = still[[k % len(still) for k in range(found.zeros)]] if len(still) else np.zeros((0, n))
        rows = found.shapes[:, _order(values)].T
        return np.vstack([zeros, *(normalized(row)[None] for row in rows)])
    forward = np.flatnonzero(values.imag > 0)
    forward = forward[np.argsort(values.imag[forward], kind="stable")]
    count = max(0, found.freedoms - forward.size)
    parts = [tidy_basis(_independent(found.still)[:, :count].T.astype(complex))]
    w = values.imag[forward]
    breaks = np.flatnonzero(np.diff(w) > TOGETHER * w[1:]) + 1
    parts += [tidy_basis(found.shapes[:, group].T) for group in np.split(forward, breaks) if group.size]
    return np.vstack([np.zeros((0, n)), *parts])


def _independent(columns: Floats) -> Floats:
    """A basis of the space of columns (n, k)."""
    if not columns.size:
        return columns
    U, sigma, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(U[:, sigma > 1e-9 * sigma.max()])


def tidy_basis(rows: Complex) -> Complex:
    """A basis (k, n) of the same space in which each row is alone at the place of its largest entry."""
    rows = rows.copy()
    if len(rows) > 1:
        for k in range(len(rows)):
            lengths = np.linalg.norm(rows[k:], axis=0)
            place = int(np.argmax(lengths >= (1 - 1e-6) * lengths.max()))
            best = k + int(np.argmax(np.abs(rows[k:, place])))
            rows[[k, best]] = rows[[best, k]]
            rows[k] /= rows[k, place]
            others = np.arange(len(rows)) != k
            rows[others] -= rows[others, place][:, None] * rows[k]
    found = [normalized(row) for row in rows]
    found.sort(key=lambda row: int(np.argmax(np.abs(row) >= 1 - EQUAL)))
    return np.array(found).reshape(rows.shape)


def normalized(row: Complex) -> Complex:
    """A shape (n,) with its largest entry, the first of them, 1."""
    size = np.abs(row)
    if not size.any():
        return row
    row = row / row[int(np.argmax(size >= (1 - EQUAL) * size.max()))]
    real, imag = (np.where(np.abs(part) <= NOTHING, 0.0, part) for part in (row.real, row.imag))
    real, imag = (np.where(np.abs(np.abs(x) - 1) <= ROUNDED, np.sign(x), x) for x in (real, imag))
    return np.asarray(real + 1j * imag)
