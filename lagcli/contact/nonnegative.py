"""Least squares with weights that are not negative, by SciPy, and not believed before they are proved.

`scipy.optimize.nnls` has given wrong answers where columns are dependent in several releases (scipy issues 21630,
25389), and dependent columns are what contacts have. Another order of the columns, and another method, give other
proposals.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

EPS = float(np.finfo(float).eps)
# Of columns of about length one: what a gradient may be off.
OFF = 1e-9


def proposals(columns: Floats, target: Floats) -> Iterator[Floats]:
    """Weights w (k,) >= 0 that may be those of the least |columns w - target|, columns (m, k); each may be wrong."""
    from scipy import optimize

    most = 30 * columns.shape[1] + 100
    for order in (slice(None), slice(None, None, -1)):
        try:
            yield np.asarray(optimize.nnls(columns[:, order], target, maxiter=most)[0])[order]
        except RuntimeError:
            continue
    try:
        found = optimize.lsq_linear(columns, target, (0, np.inf), method="bvls", tol=EPS)
    except np.linalg.LinAlgError:
        return
    yield np.where(found.active_mask == 0, found.x, 0.0)


def residual(columns: Floats, target: Floats) -> Floats | None:
    """target - columns w (m,) for the best w >= 0, proved by its conditions; None where no proposal meets them."""
    size = float(np.linalg.norm(target))
    for weights in proposals(columns, target):
        left = target - columns @ weights
        gradient = columns.T @ left
        if (gradient <= OFF * size).all() and abs(float(weights @ gradient)) <= OFF * size * size:
            return np.asarray(left)
    return None
