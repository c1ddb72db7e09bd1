"""Allowed and virtual displacements, independent components, forces between particles."""

import json
import pathlib

import numpy as np
import pytest

import lagcli
from lagcli.api import cache
from lagcli.start import initial
from tests.helpers.in_process import command  # noqa: F401 - a fixture

MODELS = pathlib.Path(__file__).parents[2] / "models"
NAMES = sorted(path.stem for path in MODELS.glob("*.yaml"))
# 3N - rank or n - rank where it is not n less the rows: redundant rows.
REDUNDANT = {"twin-rod": 1, "braced-square": 1, "bricard": 1, "four-legged-table": 3}


def load(name):
    return lagcli.load(MODELS / f"{name}.yaml")


def rows(model, found):
    """B (C, n) and b (C,) of unit rows, and M, at the state of an answer."""
    ready = cache.compiled(model)
    p = initial.declared(ready.system).p
    B, b = (np.array(x) for x in ready.numeric.rows(found.t, found.q, found.v, p))
    lengths = np.linalg.norm(B, axis=1)
    M = np.array(ready.numeric.inertia(found.t, found.q, found.v, p))
    return B / lengths[:, None], b.ravel() / lengths, M


@pytest.mark.parametrize("name", NAMES)
def test_bases_of_the_gallery(name):
    model = load(name)
    start = model.simulation.start
    found = lagcli.displacements(model, start + 0.02 * model.simulation.duration)
    B, b, M = rows(model, found)
    virtual, n = found.bases.virtual, len(found.q)
    size = np.linalg.norm(virtual, axis=0).max(initial=0.0)
    assert np.abs(B @ virtual).max(initial=0.0) <= 1e-12 * max(1.0, size)
    assert found.bases.residual <= 1e-12
    assert np.abs(B @ found.bases.allowed + b).max(initial=0.0) <= 1e-12 * max(
        1.0, np.abs(b).max(initial=0.0)
    )
    rank = np.linalg.matrix_rank(B, tol=1e-9) if len(B) else 0
    assert found.bases.dimension == n - rank == virtual.shape[1]
    assert found.bases.dimension == REDUNDANT.get(name, n - len(B))
    np.testing.assert_allclose(virtual.T @ M @ virtual, np.eye(virtual.shape[1]), atol=1e-10)
    # The motion itself is an allowed displacement: what is left after `allowed` is virtual.
    rest = found.v - found.bases.allowed
    spanned = virtual @ (virtual.T @ M @ rest)
    assert np.abs(rest - spanned).max(initial=0.0) <= 1e-9 * max(1.0, np.abs(found.v).max(initial=0.0))


@pytest.mark.parametrize("name", NAMES)
def test_dependent_components_follow_from_independent_ones(name):
    model = load(name)
    found = lagcli.displacements(model)
    B, b, _ = rows(model, found)
    parts = found.components
    assert sorted((*parts.dependent, *parts.independent)) == list(range(len(found.q)))
    assert len(parts.dependent) == found.bases.rank
    random = np.random.default_rng(1)
    x = np.zeros(len(found.q))
    x[list(parts.independent)] = random.standard_normal(len(parts.independent))
    x[list(parts.dependent)] = parts.T @ x[list(parts.independent)]
    assert np.abs(B @ x).max(initial=0.0) <= 1e-11 * max(1.0, np.abs(x).max())
    x[list(parts.dependent)] += parts.tau
    assert np.abs(B @ x + b).max(initial=0.0) <= 1e-11 * max(1.0, np.abs(x).max())


@pytest.mark.parametrize("t", [0.0, 0.7])
def test_on_the_moving_ramp_only_virtual_displacements_are_along_it(t):
    found = lagcli.displacements(load("moving-ramp-stick"), t)
    alpha = np.pi / 6
    normal = np.array([-np.sin(alpha), 0, np.cos(alpha)])
    assert found.bases.dimension == 3  # 3N - rank = 6 - 3
    for k in range(2):
        assert np.abs(normal @ found.virtual_r[k]).max() < 1e-15
        # The ramp moves by V + A t in x: so much of that as is across it.
        assert normal @ found.allowed_r[k] == pytest.approx(-(1 + 2 * t) * np.sin(alpha), abs=1e-14)
    # Virtual displacements are differences of allowed ones (D.8).
    x = found.bases.allowed
    B, b, _ = rows(load("moving-ramp-stick"), found)
    one, two = (x + found.bases.virtual @ np.array(u) for u in ([1.0, 2.0, 0.5], [0.3, -1.0, 2.0]))
    assert np.abs(B @ one + b).max() < 1e-14
    assert np.abs(B @ (one - two)).max() < 1e-14
    assert [found.components.numbers[i] for i in found.components.dependent] == [3, 4, 6]


def test_a_driven_particle_has_allowed_displacements_of_its_own():
    found = lagcli.displacements(load("bead-on-rotating-hoop"), 1.0)
    theta = found.q[0]
    along = np.array([np.cos(theta) * np.cos(5), np.cos(theta) * np.sin(5), np.sin(theta)])
    np.testing.assert_allclose(
        found.virtual_r[0, :, 0], along * np.sign(found.virtual_r[0, 2, 0]), atol=1e-14
    )
    around = 5 * np.sin(theta) * np.array([-np.sin(5), np.cos(5), 0])
    np.testing.assert_allclose(found.allowed_r[0], around, atol=1e-13)
    assert not found.bases.allowed.any()
    assert found.components.numbers == (None,)


def test_numbers_count_all_particles():
    text = (
        "lagcli: 1\ncoordinates:\n  s: {}\nparticles:\n  a: {mass: 1, position: [s, 0, 0]}\n"
        "  b: {mass: 1, position: [1, 0, 0]}\nholonomic:\n  rod: distance(a, b) = 1\nsimulation: {duration: 1}\n"
    )
    found = lagcli.displacements(lagcli.loads(text))
    assert found.components.names == ("b.x", "b.y", "b.z", "s")
    assert found.components.numbers == (4, 5, 6, None)
    assert found.bases.dimension == 3


def test_a_differential_row_that_nothing_moves_along():
    """Rolling: four coordinates, two rows; x and y follow phi."""
    found = lagcli.displacements(load("rolling-disk"), 2.0)
    x, y, theta, phi = found.bases.virtual
    heading = found.q[2]
    np.testing.assert_allclose(x, 0.5 * np.sin(heading) * phi, atol=1e-13)
    np.testing.assert_allclose(y, -0.5 * np.cos(heading) * phi, atol=1e-13)
    assert np.abs(theta).max() > 0.1


BASE = """
lagcli: 1
parameters: {k: 3, l: 0.4}
particles:
  a: {mass: 1, position: [0, 0, 0], velocity: [0.1, 0, 0]}
  b: {mass: 2, position: [1, 0.5, 0]}
  c: {mass: 2, position: [0.2, 0.9, 0.7]}
forces:
  weight: {to: all, force: [0, 0, -9.81*m]}
"""


def internal(forces):
    (one,) = lagcli.displacements(lagcli.loads(BASE + forces + "simulation: {duration: 1}\n")).internal
    return one


@pytest.mark.parametrize(
    ("forces", "laws"),
    [
        ('  s: {potential: "k/2*(distance(a, b) - l)**2"}\n', ("s",)),
        ("  on_a: {to: a, force: k*(b - r)}\n  on_b: {to: b, force: k*(a - r)}\n", ("on_a", "on_b")),
        ("  on_a: {to: a, force: k*(b - r)*t}\n  on_b: {to: b, force: (a - r)*k*t}\n", ("on_a", "on_b")),
        (
            "  on_a: {to: a, force: 'k*dot(b.v - v, b - r)*(b - r)'}\n"
            "  on_b: {to: b, force: 'k*dot(a.v - v, a - r)*(a - r)'}\n",
            ("on_a", "on_b"),
        ),
    ],
)
def test_central_forces(forces, laws):
    one = internal(forces)
    assert one.laws == laws
    assert one.particles == ("a", "b")
    assert one.is_pair
    assert one.is_central


@pytest.mark.parametrize(
    ("forces", "unbalanced", "off_line"),
    [
        # Action without reaction.
        ("  on_a: {to: a, force: k*(b - r)}\n", True, None),
        ("  on_a: {to: a, force: k*(b - r)}\n  on_b: {to: b, force: 1.001*k*(a - r)}\n", True, None),
        # Opposite, but across the line.
        (
            "  on_a: {to: a, force: 'k*cross(b - r, [0, 0, 1])'}\n"
            "  on_b: {to: b, force: 'k*cross(a - r, [0, 0, 1])'}\n",
            False,
            True,
        ),
        # A dashpot between velocities is opposite, and along the line only where the motion is.
        ("  on_a: {to: a, force: b.v - v}\n  on_b: {to: b, force: a.v - v}\n", False, True),
        # A potential of a difference that is no distance.
        ("  s: {potential: k*(a.x - b.x)**2}\n", False, True),
        ("  s: {potential: k*a.x*b.x}\n", True, None),
    ],
)
def test_forces_that_are_not_central(forces, unbalanced, off_line):
    one = internal(forces)
    assert one.particles == ("a", "b")
    assert not one.is_central
    assert (one.unbalanced > 1e-6) == unbalanced
    assert off_line is None or (one.off_line > 1e-6) == off_line


def test_a_sum_of_springs_is_told_apart_and_a_force_of_three_is_not():
    text = '  s: {potential: "k/2*distance(a, b)**2 + k/2*distance(b, c)**2 + k*a.x"}\n'
    found = lagcli.displacements(lagcli.loads(BASE + text + "simulation: {duration: 1}\n")).internal
    assert [one.particles for one in found] == [("a", "b"), ("b", "c")]
    assert all(one.is_central for one in found)
    angle = "  s: {potential: 'k*dot(a - b, c - b)**2'}\n"
    one = internal(angle)
    assert one.particles == ("a", "b", "c")
    assert not one.is_pair
    assert one.is_central, "such a potential does no work on a rigid body"
    text = "  on_b: {to: b, force: k*(a - r) + k*(c - r)}\n  on_a: {to: a, force: k*(b - r)}\n"
    text += "  on_c: {to: c, force: k*(b - r)}\n"
    found = lagcli.displacements(lagcli.loads(BASE + text + "simulation: {duration: 1}\n")).internal
    assert sorted(one.particles for one in found) == [("a", "b"), ("b", "c")]
    assert all(one.is_pair and one.is_central for one in found)
    one = internal("  s: {potential: k*a.x*b.x*c.x}\n")
    assert not one.is_central
    one = internal("  on_a: {to: a, force: 'distance(b, c)*(b - r)'}\n")
    assert one.particles == ("a", "b", "c")
    assert not one.is_central


def test_forces_between_dependent_particles():
    text = """
lagcli: 1
coordinates:
  u: {value: 0}
  w: {value: 2}
particles:
  a: {mass: 1, position: [u, u**2, 0]}
  b: {mass: 1, position: [w, 1, 0]}
forces:
  spring: {potential: "2*(distance(a, b) - 1)**2"}
  wrong: {potential: 2*a.x*b.y}
  hinge: {potential: (u - w)**2}
simulation: {duration: 1}
"""
    found = {one.laws[0]: one for one in lagcli.displacements(lagcli.loads(text)).internal}
    assert set(found) == {"spring", "wrong"}
    assert found["spring"].is_central
    assert found["spring"].force == pytest.approx(2 * 4 * (np.sqrt(5) - 1))
    assert not found["wrong"].is_central


def test_families_of_the_gallery():
    found = lagcli.displacements(load("solar-system")).internal
    assert len(found) == 15  # six bodies
    assert all(one.is_pair and one.is_central for one in found)


def test_the_command(command, tmp_path):  # noqa: F811
    out, err, code = command("displacements", MODELS / "moving-ramp-stick.yaml", "--at", "0.5")
    assert (code, err) == (0, "")
    assert "3N - rank = 6 - 3 = 3 virtual displacements" in out
    assert "dependent: x_3 = a.z, x_4 = b.x, x_6 = b.z" in out
    assert "da.z = 0.57735 da.x - 1.1547 dt" in out
    assert "db.x = da.x\n" in out
    out, _, code = command("displacements", MODELS / "spring-triangle.yaml", "--json")
    told = json.loads(out)
    assert code == 0
    assert told["dimension"] == 9
    assert told["metric"] == "mass"
    assert np.array(told["virtual"]).shape == (9, 9)
    assert [one["central"] for one in told["internal_forces"]] == [True] * 3
    out, _, code = command("displacements", MODELS / "chain.yaml")
    assert code == 0
    assert "192 more of the basis are given with --json" in out


def test_exit_codes(command, tmp_path):  # noqa: F811
    pendulum = MODELS / "pendulum.yaml"
    for at in ("-1", "nan", "inf"):
        _, err, code = command("displacements", pendulum, "--at", at)
        assert code == 2
        assert "--at: a time from the start on, t = 0, is needed" in err
    assert command("displacements", "none.yaml")[2] == 2
    off = tmp_path / "off.yaml"
    off.write_text(pendulum.read_text(encoding="utf-8").replace("a.y = 0", "a.y = 0.1"), encoding="utf-8")
    out, err, code = command("displacements", off, "--json")
    assert code == 1
    assert json.loads(out)["errors"][0]["code"] == "inconsistent-start"
    assert command("displacements", off, "--assemble")[2] == 0
    ends = tmp_path / "ends.yaml"
    ends.write_text("lagcli: 1\ncoordinates: {x: {value: 1}}\nlagrangian: rate(x)**2/2 + 1/x\n")
    _, err, code = command("displacements", ends, "--at", "2")
    assert code == 3
    assert err.startswith("lagcli: ")


def test_the_start_may_be_later():
    text = BASE + "holonomic:\n  wall: a.x = 0.1*t - 0.1\nsimulation: {start: 1, duration: 1}\n"
    assert lagcli.displacements(lagcli.loads(text)).t == 1.0
    found = lagcli.displacements(lagcli.loads(text), at=1.5)
    assert found.t == 1.5
    assert found.q[0] == pytest.approx(0.05, abs=1e-14)
    assert found.bases.allowed[0] == pytest.approx(0.1)
    with pytest.raises(ValueError, match="from the start on, t = 1"):
        lagcli.displacements(lagcli.loads(text), at=0.5)


def test_too_many_coordinates_are_refused():
    text = "lagcli: 1\nparticles:\n  p[i]: {for: 'i = 1..1334', mass: 1, position: '[i, 0, 0]'}\n"
    with pytest.raises(ValueError, match="the model has 4002 coordinates"):
        lagcli.displacements(lagcli.loads(text))
