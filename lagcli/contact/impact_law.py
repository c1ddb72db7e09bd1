"""The law of impact, and the forces of contacts that stay closed (theory of one-sided constraints; Moreau).

Impact: M (v+ - v-) = B^T Lambda + G^T Lambda_G and 0 <= Lambda_G ⊥ dg/dt+ + e min(dg/dt-, 0) >= 0; contact:
 0 <= lambda ⊥ d2g/dt2 = G a - gamma >= 0. Both are the point of least kinetic distance that satisfies
B x = r and G x >= s, whose multipliers least-distance programming gives (Lawson and Hanson, Solving Least Squares
Problems, ch. 23).
"""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

from lagcli.linear.metric import Metric
from lagcli.linear.metric_rows import Sparse

Floats = npt.NDArray[np.float64]
EPS = float(np.finfo(float).eps)


class LawError(Exception):
    """Contacts, by their places among those given, for which the law has no answer."""

    def __init__(self, text: str, contacts: tuple[int, ...]) -> None:
        super().__init__(text)
        self.contacts = contacts


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class LawResult:
    """x (n,), velocities after an impact or accelerations, and impulses or forces of the rows, (C,) and (k,)."""

    x: Floats
    of_equalities: Floats
    of_contacts: Floats


def impact(
    metric: Metric, v: Floats, equalities: tuple[Sparse, Floats], contacts: tuple[Sparse, Floats, Floats]
) -> LawResult:
    """The impact of contacts G v + g_t with coefficients e, (G, g_t, e), held by rows B v + b = 0, (B, b)."""
    (B, b), (G, g_t, e) = equalities, contacts
    speeds = np.array(G) @ v + g_t
    return _nearest(metric, v, (B, -b), (G, -e * np.minimum(speeds, 0.0) - g_t))


def forces(
    metric: Metric, h: Floats, equalities: tuple[Sparse, Floats], contacts: tuple[Sparse, Floats]
) -> LawResult:
    """The accelerations and forces under h with rows B a = gamma, (B, gamma), and contacts G a >= gamma, (G, gamma)."""
    return _nearest(metric, metric.solved(h), equalities, contacts)


def _nearest(
    metric: Metric, x: Floats, equalities: tuple[Sparse, Floats], contacts: tuple[Sparse, Floats]
) -> LawResult:
    (B, r), (G, s) = equalities, contacts
    Bw, Gw = (np.array(metric.whitened(rows)) for rows in (B, G))
    S = Bw @ Bw.T
    first = np.linalg.solve(S, r - np.array(B) @ x) if r.size else np.zeros(0)
    onto = x + metric.unwhitened(Bw.T @ first)
    coupling = np.linalg.solve(S, Bw @ Gw.T) if r.size else np.zeros((0, s.size))
    projected = Gw - coupling.T @ Bw
    pressing = _least_distance(projected, s - np.array(G) @ onto)
    held = -coupling @ pressing
    return LawResult(onto + metric.unwhitened(Bw.T @ held + Gw.T @ pressing), first + held, pressing)


def _least_distance(G: Floats, h: Floats) -> Floats:
    """The multipliers (k,) of the shortest x with G x >= h."""
    if (h <= 0).all():
        return np.zeros(h.size)
    if h.size == 1:
        square = float(G[0] @ G[0])
        if not square > 0:
            raise LawError("no impulse can part", (0,))
        return h / square
    from scipy import optimize

    lengths = np.linalg.norm(G, axis=1)
    lengths = np.where(lengths > 0, lengths, 1.0)
    rows, heights = G / lengths[:, None], h / lengths
    size = float(np.abs(heights).max())
    target = np.zeros(G.shape[1] + 1)
    target[-1] = 1.0
    weights = optimize.nnls(np.vstack([rows.T, heights / size]), target)[0]
    left = 1.0 - float(weights @ heights) / size
    if left < 1e3 * EPS:
        raise LawError("no impulses can part", tuple(np.flatnonzero(weights > 0).tolist()))
    multipliers = np.asarray(weights / left * size)
    on = multipliers > 0
    # The active set is exact; its multipliers are to be so to rounding.
    exact = np.linalg.lstsq(rows[on] @ rows[on].T, heights[on], rcond=1e-12)[0]
    if (exact >= 0).all():
        multipliers[on] = exact
    return multipliers / lengths
