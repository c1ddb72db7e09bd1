"""Rigid bodies against the Newton-Euler equations, integrated on their own."""

import dataclasses
import functools
from collections.abc import Callable

import numpy as np
import pytest
from scipy import integrate

import lagcli

DURATION, SAMPLES = 2.0, 21
TOLERANCE = 1e-10


def written(vector):
    return "[" + ", ".join(repr(float(x)) for x in vector) + "]"


@dataclasses.dataclass(frozen=True)
class Body:
    """Particles of a body with their start, a force on one of them, and the text of that force."""

    masses: list
    points: list
    spin: list
    drift: list
    force_on: int
    force: Callable
    law: str
    dof: int

    @property
    def names(self):
        return [f"p{k}" for k in range(len(self.masses))]

    @property
    def text(self):
        velocities = np.array(self.drift) + np.cross(self.spin, self.points)
        lines = ["lagcli: 1", "particles:"]
        for name, m, r, v in zip(self.names, self.masses, self.points, velocities, strict=True):
            lines.append(f"  {name}: {{mass: {float(m)!r}, position: {written(r)}, velocity: {written(v)}}}")
        lines += ["forces:", f'  push: {{to: p{self.force_on}, force: "{self.law}"}}']
        lines += ["rigid:", f"  body: [{', '.join(self.names)}]"]
        return "\n".join(lines) + "\n"

    def newton_euler(self):
        """Positions, velocities and accelerations (T, K, 3) of the particles, and the force (T, 3) on one.

        State: centre X, momentum P, rotation matrix Q, angular momentum J about the centre.
        """
        masses, points = np.array(self.masses, float), np.array(self.points, float)
        M = masses.sum()
        X0 = masses @ points / M
        rho0 = points - X0
        inertia0 = sum(m * (r @ r * np.eye(3) - np.outer(r, r)) for m, r in zip(masses, rho0, strict=True))
        inverse0 = np.linalg.pinv(inertia0)  # a line has no inertia about itself and no spin about itself

        def parts(y):
            Q = y[6:15].reshape(3, 3)
            return y[0:3], y[3:6] / M, Q, y[15:18], Q @ inverse0 @ Q.T

        def rate(t, y):
            X, V, Q, J, inverse = parts(y)
            rho = rho0 @ Q.T
            F = self.force(t, X + rho)
            omega = inverse @ J
            return np.concatenate([V, F, np.cross(omega, Q.T).T.ravel(), np.cross(rho[self.force_on], F)])

        J0 = np.einsum("k,ki->i", masses, np.cross(rho0, np.cross(self.spin, rho0)))
        V0 = np.array(self.drift) + np.cross(self.spin, X0)
        y0 = np.concatenate([X0, M * V0, np.eye(3).ravel(), J0])
        times = np.linspace(0, DURATION, SAMPLES)
        found = integrate.solve_ivp(rate, (0, DURATION), y0, "DOP853", times, rtol=1e-13, atol=1e-14)
        r, v, a, forces = [], [], [], []
        for t, y in zip(times, found.y.T, strict=True):
            X, V, Q, J, inverse = parts(y)
            rho = rho0 @ Q.T
            F, omega = self.force(t, X + rho), inverse @ J
            alpha = inverse @ (np.cross(rho[self.force_on], F) - np.cross(omega, J))
            r.append(X + rho)
            v.append(V + np.cross(omega, rho))
            a.append(F / M + np.cross(alpha, rho) + np.cross(omega, np.cross(omega, rho)))
            forces.append(F)
        return np.array(r), np.array(v), np.array(a), np.array(forces)


def corner_force_in_space(t, r):
    return np.array([2.0 * np.cos(3 * t), -1.0, 0.5 * t])


def edge(i, j):
    return lambda t, r: 3.0 * (r[j] - r[i])


def normal(t, r):
    return 2.0 * np.cross(r[1] - r[0], r[2] - r[0])


LINE = [[0, 0, 0], [1, 0.5, -0.2], [2, 1, -0.4]]
SQUARE = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
CUBE = [[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]
SPACE = "[2*cos(3*t), -1, 0.5*t]"

BODIES = {
    # The spin of a line has no part along it.
    "line, force fixed in space": Body(
        [1, 2, 0.5], LINE, [0.2, -0.4, 0], [0.1, 0.2, 0.3], 2, corner_force_in_space, SPACE, 5
    ),
    "line, force along it": Body(
        [1, 2, 0.5], LINE, [0.2, -0.4, 0], [0, 0, 1], 0, edge(0, 1), "3*(p1 - p0)", 5
    ),
    "plate, force fixed in space": Body(
        [1, 2, 3, 4], SQUARE, [0.3, 1, -2], [0, 1, 0], 2, corner_force_in_space, SPACE, 6
    ),
    "plate, force along its normal": Body(
        [1, 1, 1, 1], SQUARE, [0.3, 0.1, 2], [0, 0, 0], 3, normal, "2*cross(p1 - p0, p2 - p0)", 6
    ),
    "cube, force fixed in space": Body(
        [1, 1, 1, 1, 1, 1, 1, 2], CUBE, [1, -2, 0.5], [0.3, 0, 0], 7, corner_force_in_space, SPACE, 6
    ),
    "cube, force along an edge": Body(
        [1, 2, 1, 2, 1, 2, 1, 3], CUBE, [1, 0, 0.5], [0, 0, 0], 7, edge(7, 3), "3*(p3 - p7)", 6
    ),
}
EACH = pytest.mark.parametrize("name", BODIES)


@functools.cache
def both(name):
    """The table of the body, and what Newton-Euler says."""
    body = BODIES[name]
    table = lagcli.simulate(
        lagcli.loads(body.text), duration=DURATION, samples=SAMPLES, rtol=1e-12, atol=1e-14
    )
    return table, body.newton_euler()


def vectors(table, names, pattern):
    """Columns of all particles, shape (T, K, 3)."""
    return np.moveaxis(np.array([[table[pattern.format(n, c)] for c in "xyz"] for n in names]), -1, 0)


def reactions(name):
    return vectors(both(name)[0], BODIES[name].names, "R.{}.{}")


def close(found, expected, tolerance=TOLERANCE):
    return bool(np.abs(found - expected).max() <= tolerance * max(1.0, np.abs(expected).max()))


@EACH
def test_positions_and_velocities_are_those_of_newton_and_euler(name):
    table, (r, v, _, _) = both(name)
    assert close(vectors(table, BODIES[name].names, "{}.{}"), r)
    assert close(vectors(table, BODIES[name].names, "{}.v{}"), v)
    assert np.ptp(r, axis=0).max() > 0.5


@EACH
def test_reaction_on_each_particle_is_m_a_minus_f(name):
    body, (_, (_, _, a, F)) = BODIES[name], both(name)
    expected = np.array(body.masses)[:, None] * a
    expected[:, body.force_on] -= F
    assert close(reactions(name), expected)
    assert np.abs(expected).max() > 0.1


@EACH
def test_inner_forces_have_no_sum_no_moment_and_no_power(name):
    table, (r, v, _, _) = both(name)
    R = reactions(name)
    scale = np.abs(R).max()
    assert np.abs(R.sum(axis=1)).max() <= 1e-12 * scale
    assert np.abs(np.cross(r, R).sum(axis=1)).max() <= TOLERANCE * scale * np.abs(r).max()
    assert np.abs((R * v).sum(axis=(1, 2))).max() <= TOLERANCE * scale * np.abs(v).max()
    assert table.stats.energy_imbalance <= TOLERANCE


@EACH
def test_total_force_and_torque_are_the_applied_ones(name):
    body, (_, (r, _, a, F)) = BODIES[name], both(name)
    total = reactions(name)
    total[:, body.force_on] += F
    centre = (np.array(body.masses)[:, None] * r).sum(axis=1) / sum(body.masses)
    arms = r - centre[:, None]
    assert close(total.sum(axis=1), F)
    assert close(np.cross(arms, total).sum(axis=1), np.cross(arms[:, body.force_on], F))
    assert close(total.sum(axis=1), (np.array(body.masses)[:, None] * a).sum(axis=1))


@EACH
def test_distances_stay(name):
    r = vectors(both(name)[0], BODIES[name].names, "{}.{}")
    between = np.linalg.norm(r[:, :, None] - r[:, None], axis=-1)
    assert np.abs(between - between[0]).max() <= 1e-12


@EACH
def test_count_and_rows(name):
    body = BODIES[name]
    counted = lagcli.dof(lagcli.loads(body.text))
    assert (counted.configuration_dof, counted.redundant) == (body.dof, 0)
    rows = [column for column in both(name)[0].columns if column.startswith("lambda.body.")]
    assert rows == [f"lambda.body.{i}" for i in range(1, 3 * len(body.masses) - body.dof + 1)]
    assert both(name)[0].multiplier("body").shape == (SAMPLES, len(rows))


def test_base_takes_the_first_particles_that_span_the_body():
    # p2 lies on the line of p0 and p1: the base is p0, p1, p3, and p2 is tied by three linear rows.
    text = """
lagcli: 1
particles:
  p0: {mass: 1, position: [0, 0, 0]}
  p1: {mass: 1, position: [1, 0, 0]}
  p2: {mass: 1, position: [3, 0, 0]}
  p3: {mass: 1, position: [0, 2, 0]}
forces:
  pull: {to: p1, force: [6, 0, 0]}
  back: {to: p0, force: [-6, 0, 0]}
rigid:
  body: [p0, p1, p2, p3]
"""
    table = lagcli.simulate(lagcli.loads(text), duration=1, samples=3)
    # In equilibrium the distance (1, 2) carries the pull: f = distance - length, so lambda = -6.
    assert np.abs(table["lambda.body.1"] + 6).max() <= 1e-12
    assert np.abs(table.multiplier("body")[:, 1:]).max() <= 1e-12
    assert np.abs(table.reaction("p1") - [-6, 0, 0]).max() <= 1e-12
    assert lagcli.dof(lagcli.loads(text)).configuration_dof == 6


def test_a_pair_is_a_rod():
    text = "lagcli: 1\nparticles:\n  a: {mass: 1, position: [0, 0, 0]}\n  b: {mass: 3, position: [0, 0, 2]}\n"
    counted = lagcli.dof(lagcli.loads(text + "rigid:\n  rod: [a, b]\n"))
    assert (counted.configuration_dof, counted.holonomic) == (5, 1)


@pytest.mark.parametrize("height", [1e-3, 1e-5, 2e-6, 1e-7, 1e-10])
def test_a_body_that_is_almost_flat_moves_like_the_flat_one(height):
    text = """
lagcli: 1
particles:
  a: {mass: 1, position: [0, 0, 0], velocity: [0, 0, 0]}
  b: {mass: 1, position: [1, 0, 0], velocity: [0, 1, 0]}
  c: {mass: 1, position: [0, 1, 0], velocity: [-1, 0, 0]}
  e: {mass: 1, position: [1, 1, HEIGHT], velocity: [-1, 1, 0]}
forces: {push: {to: a, force: [1, 2, 3]}}
rigid: {body: [a, b, c, e]}
"""
    flat = lagcli.simulate(lagcli.loads(text.replace("HEIGHT", "0")), duration=2, samples=5)
    model = lagcli.loads(text.replace("HEIGHT", repr(height)))
    assert lagcli.dof(model).configuration_dof == 6
    run = lagcli.simulate(model, duration=2, samples=5)
    assert run.stats.steps < 2 * flat.stats.steps
    for column in ("e.x", "R.e.z", "R.c.x"):
        assert np.abs(run[column] - flat[column]).max() < 10 * height + 1e-9


def test_a_body_whose_first_particles_are_nearly_in_a_line_takes_no_thousands_of_steps():
    """Its rows are within 2e-3 of dependent ones, and their forces are known to 1e-8: no shorter step knows better."""
    text = """lagcli: 1
particles:
  a: {mass: 1.412, position: [-0.421, 0.193, 0.477]}
  b: {mass: 1.368, position: [0.389, -0.259, 0.813]}
  c: {mass: 1.145, position: [-0.756, 0.359, 0.413]}
  d: {mass: 0.642, position: [0.051, 0.69, -0.791]}
  e: {mass: 1.436, position: [-0.833, -0.222, -0.661]}
  f: {mass: 1.652, position: [-0.211, -0.494, -0.701]}
forces:
  weight: {to: all, force: "[0, 0, -6*m]"}
  spring: {potential: "8*norm(a)**2"}
rigid: {body: [ORDER]}
simulation: {duration: 1, samples: 11}
"""
    slanted, square = (
        lagcli.simulate(lagcli.loads(text.replace("ORDER", order)))
        for order in ("a, b, c, d, e, f", "a, b, d, f, c, e")
    )
    assert slanted.stats.steps < 300
    for name in (*"abcdef", "energy"):
        for axis in (".x", ".y", ".z") if name != "energy" else ("",):
            assert slanted[name + axis] == pytest.approx(square[name + axis], abs=1e-9)
    assert slanted.reaction("e") == pytest.approx(square.reaction("e"), abs=1e-6)
