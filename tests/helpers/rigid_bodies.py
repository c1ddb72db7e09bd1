"""An independent code of rigid bodies: Newton's and Euler's equations with joints as rows in velocities and omegas.

Nothing of `lagcli` is in it. A body is (c, R, v, omega) with mass and inertia in its axes; rows are solved for with
their accelerations, and SciPy integrates the motion.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from scipy import integrate

H = 1e-30  # of the complex step: exact for rows, which are polynomials


@dataclasses.dataclass
class Body:
    mass: float
    inertia: np.ndarray
    c: np.ndarray
    R: np.ndarray
    v: np.ndarray
    omega: np.ndarray


@dataclasses.dataclass
class Row:
    """One row between bodies a and b (-1: the ground), of places and directions fixed in each.

    kind: `gap` component k of q - p; `dot` of u and w; `slide` of q - p with u.
    """

    joint: int
    kind: str
    a: int
    b: int
    p: np.ndarray
    q: np.ndarray
    u: np.ndarray
    w: np.ndarray
    k: int = 0


def skew(x):
    return np.array([[0 * x[0], -x[2], x[1]], [x[2], 0 * x[0], -x[0]], [-x[1], x[0], 0 * x[0]]])


def gradient(row: Row, c, R) -> np.ndarray:
    """The row (12,) by v_a, omega_a, v_b, omega_b, at centres c and axes R, the ground's being 0 and 1."""
    ca, Ra = (np.zeros(3), np.eye(3)) if row.a < 0 else (c[row.a], R[row.a])
    cb, Rb = (np.zeros(3), np.eye(3)) if row.b < 0 else (c[row.b], R[row.b])
    ra, rb, u, w = Ra @ row.p, Rb @ row.q, Ra @ row.u, Rb @ row.w
    if row.kind == "gap":
        e = np.eye(3)[row.k]
        return np.concatenate([-e, -np.cross(ra, e), e, np.cross(rb, e)])
    if row.kind == "dot":
        turn = np.cross(u, w)
        return np.concatenate([np.zeros(3), turn, np.zeros(3), -turn])
    gap = cb + rb - ca - ra
    return np.concatenate([-u, -np.cross(ra, u) + np.cross(u, gap), u, np.cross(rb, u)])


def matrix(rows: Sequence[Row], c, R) -> np.ndarray:
    n = len(c)
    A = np.zeros((len(rows), 6 * n), dtype=np.result_type(*(x.dtype for x in c)))
    for i, row in enumerate(rows):
        found = gradient(row, c, R)
        for body, part in ((row.a, found[:6]), (row.b, found[6:])):
            if body >= 0:
                A[i, 6 * body : 6 * body + 6] += part
    return A


def accelerations(bodies: Sequence[Body], rows: Sequence[Row], g: float):
    """(6 n,) accelerations and the multipliers (C,), those of least squares where rows are dependent."""
    c, R = [b.c for b in bodies], [b.R for b in bodies]
    u = np.concatenate([np.concatenate([b.v, b.omega]) for b in bodies])
    A = matrix(rows, c, R)
    moved = matrix(
        rows,
        [b.c + 1j * H * b.v for b in bodies],
        [b.R + 1j * H * skew(b.omega) @ b.R for b in bodies],
    )
    gamma = -(moved.imag / H) @ u
    M, h = np.zeros((u.size, u.size)), np.zeros(u.size)
    for i, b in enumerate(bodies):
        J = b.R @ b.inertia @ b.R.T
        M[6 * i : 6 * i + 3, 6 * i : 6 * i + 3] = b.mass * np.eye(3)
        M[6 * i + 3 : 6 * i + 6, 6 * i + 3 : 6 * i + 6] = J
        h[6 * i + 2] = -b.mass * g
        h[6 * i + 3 : 6 * i + 6] = -np.cross(b.omega, J @ b.omega)
    W = np.linalg.inv(M)
    lam = np.linalg.lstsq(A @ W @ A.T, gamma - A @ W @ h, rcond=1e-11)[0]
    return W @ (h + A.T @ lam), lam, A


def reaction(lines: np.ndarray, lam: np.ndarray, body: int, arm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Force and torque of some rows (k, 6 n) on a body, about a place at an arm from its centre."""
    f = lines[:, 6 * body : 6 * body + 6].T @ lam
    return f[:3], f[3:] - np.cross(arm, f[:3])


def unpacked(bodies: Sequence[Body], y: np.ndarray) -> list[Body]:
    parts = y.reshape(len(bodies), 18)
    return [
        dataclasses.replace(b, c=s[:3], R=s[3:12].reshape(3, 3), v=s[12:15], omega=s[15:])
        for b, s in zip(bodies, parts, strict=True)
    ]


def run(bodies: Sequence[Body], rows: Sequence[Row], g: float, t: float) -> list[Body]:
    """The bodies after a time."""

    def rate(_, y):
        now = unpacked(bodies, y)
        a = accelerations(now, rows, g)[0].reshape(len(bodies), 6)
        return np.concatenate(
            [np.concatenate([b.v, (skew(b.omega) @ b.R).ravel(), own]) for b, own in zip(now, a, strict=True)]
        )

    y = np.concatenate([np.concatenate([b.c, b.R.ravel(), b.v, b.omega]) for b in bodies])
    found = integrate.solve_ivp(rate, (0, t), y, method="DOP853", rtol=1e-12, atol=1e-13)
    return unpacked(bodies, found.y[:, -1])
