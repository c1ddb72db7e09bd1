"""A rigid body as point masses: P of them, where P = 1/2 tr J 1 - J = sum m rho rho^T has the rank P - 1.

m sigma_i^2 are the eigenvalues of P, and the particles stand along its principal axes:

    rank 3   four of m/4   c + R (+-sigma_x, +-sigma_y, +-sigma_z), signs +++, +--, -+-, --+
    rank 2   three of m/3  c + sqrt(2) R (sigma_x cos phi_k, sigma_y sin phi_k, 0), phi_k = 0, 120, 240 degrees
    rank 1   two of m/2    c +- sigma_x R e_x
    rank 0   one           c

Mass, centre and inertia are those of the body, and so are T, momenta and all forces of uniform fields.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.frozen import frozen

SIGNS = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], dtype=float)


class ImpossibleInertia(ValueError):
    """No body has such an inertia; the text says which inequality it breaks."""


@frozen
class PointMasses:
    """places (P, 3): from the centre, in the axes of the body; directions (3, P), normal (3,): axis j of the body is
    sum_k directions_jk r_k + normal_j e_a x e_b, with the directions e_a, e_b (2, P) in the plane of a flat body."""

    places: Floats
    directions: Floats
    normal: Floats
    plane: Floats

    @property
    def count(self) -> int:
        """P."""
        return len(self.places)

    def holds(self, vector: Floats) -> bool:
        """True if a vector (3,) in the axes of the body is fixed in it: of a rod, along its axis; of a point, none."""
        if self.count > 2:
            return True
        axis = self.places[0] / (np.linalg.norm(self.places[0]) or 1.0)
        off = vector - axis * (axis @ vector)
        return bool(np.linalg.norm(off) <= doubles.ZERO * np.linalg.norm(vector))

    def weights(self, point: Floats) -> tuple[Floats, float]:
        """The weights (P,) of a point (3,) in the axes of the body, from its centre, and that of the normal."""
        return 1.0 / self.count + point @ self.directions, float(point @ self.normal)


def point_masses(mass: float, inertia: Floats) -> PointMasses:
    """The particles of a body of this mass and inertia (3, 3) about its centre. Raises `ImpossibleInertia`."""
    second = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    is_diagonal = not (inertia - np.diag(inertia.diagonal())).any()
    values, axes = (second.diagonal(), np.eye(3)) if is_diagonal else np.linalg.eigh(second)
    if not is_diagonal and np.linalg.det(axes) < 0:
        axes = -axes
    size = float(np.abs(values).sum())
    # An eigenvalue that is rounding is 0, and one that is more below 0 is none of a body.
    rounding = doubles.VALUE * size
    if values.min() < -rounding:
        least = int(np.argmin(values))
        moments = np.trace(second) - values
        first, other = (moments[i] for i in range(3) if i != least)
        raise ImpossibleInertia(
            f"the principal moments {first:.6g} + {other:.6g} are less than {moments[least]:.6g}, by"
            f" {-2 * values[least]:.3g}: no body has this inertia"
        )
    kept = np.flatnonzero(values > rounding)
    sigma = np.sqrt(np.maximum(values, 0.0) / mass)
    none = np.zeros(3), np.zeros((2, 0))
    if kept.size == 3:
        return PointMasses(SIGNS * sigma @ axes.T, axes @ (SIGNS / (4 * sigma)).T, *none)
    if kept.size == 2:
        a, b = kept.tolist()
        if (a, b) == (0, 2):  # so that e_a x e_b is the third axis
            a, b = 2, 0
        turns = 2 * np.pi / 3 * np.arange(3)
        x, y = np.sqrt(2) * sigma[a] * np.cos(turns), np.sqrt(2) * sigma[b] * np.sin(turns)
        plane = np.array([x / (3 * sigma[a] ** 2), y / (3 * sigma[b] ** 2)])
        across = axes[:, 3 - a - b]
        return PointMasses(
            np.outer(x, axes[:, a]) + np.outer(y, axes[:, b]),
            np.outer(axes[:, a], plane[0]) + np.outer(axes[:, b], plane[1]),
            across,
            plane,
        )
    if kept.size == 1:
        a = int(kept[0])
        ends = np.array([sigma[a], -sigma[a]])
        return PointMasses(
            np.outer(ends, axes[:, a]), np.outer(axes[:, a], ends / (2 * sigma[a] ** 2)), *none
        )
    return PointMasses(np.zeros((1, 3)), np.zeros((3, 1)), *none)


def shape(kind: str, mass: float, sizes: Mapping[str, Floats]) -> Floats:
    """The inertia (3, 3) about the centre of a homogeneous solid; round ones turn about z, a rod lies along x."""
    r2 = float(sizes["radius"][0]) ** 2 if "radius" in sizes else 0.0
    inner = float(sizes["inner"][0]) ** 2 if "inner" in sizes else r2
    l2 = float(sizes["length"][0]) ** 2 if "length" in sizes else 0.0
    if kind == "sphere":
        return np.asarray(mass * 0.4 * r2 * np.eye(3))
    if kind == "box":
        a, b, c = sizes["size"] ** 2
        return np.asarray(mass / 12 * np.diag([b + c, a + c, a + b]))
    if kind == "rod":
        return np.asarray(mass / 12 * np.diag([0.0, l2, l2]))
    round_ = r2 + inner if kind == "tube" else r2
    across = round_ / 4 + l2 / 12
    return np.asarray(mass * np.diag([across, across, round_ / 2]))


def rotation(axis: Floats, angle: float) -> Floats:
    """The rotation (3, 3) about an axis (3,) of length one (Rodrigues)."""
    x, y, z = axis
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K)
