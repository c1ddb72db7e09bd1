"""The same motion written in another way: R and the motion transform as they must."""

import dataclasses
import functools
import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import lagcli

FEW = settings(max_examples=6)
DURATION, SAMPLES = 0.8, 17


@dataclasses.dataclass(frozen=True)
class Writing:
    """A way to write one system: units, frame, names, order, and the factor of each constraint."""

    length: float = 1.0
    mass: float = 1.0
    time: float = 1.0
    frame: tuple = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    names: tuple = ("a", "b", "c")
    particle_order: tuple = (0, 1, 2)
    row_order: tuple = (0, 1, 2)
    force_order: tuple = (0, 1, 2, 3)
    factors: tuple = (1.0, 1.0, 1.0, 1.0)
    rows: tuple = ("rod", "link", "table")


PLAIN = Writing()
MASSES = (1.3, 0.7, 2.1)
PLACES = ((0.6, 0.0, -0.8), (1.1, 0.7, -1.3), (-0.4, 0.9, -0.2))


def rotated(writing, vector):
    """A vector of the plain writing in the frame and the unit of length of another, as text."""
    turned = np.array(writing.frame) @ np.array(vector) * writing.length
    return "[" + ", ".join(repr(float(x)) for x in turned) + "]"


def text(w):
    """Three particles on a rod, a link, a moving table and a nonholonomic row; forces of all kinds."""
    a, b, c = w.names
    # A constant force has the unit of m l/t^2, a stiffness m/t^2, a friction m/t.
    newton = w.mass / w.time**2  # times a length that `rotated` brings
    link = float(np.linalg.norm(np.subtract(PLACES[0], PLACES[1]))) * w.length
    particles = [
        f"  {name}: {{mass: {m * w.mass!r}, position: {rotated(w, r)}}}"
        for name, m, r in zip(w.names, MASSES, PLACES, strict=True)
    ]
    forces = [
        f'  weight: {{to: all, force: "m*{9.81 / w.time**2!r}*{rotated(w, (0, 0, -1))}"}}',
        f'  spring: {{potential: "{6 * newton!r}*(distance({a}, {c}) - {0.8 * w.length!r})**2/2"}}',
        f"  drag: {{to: [{a}, {c}], force: {-0.3 * w.mass / w.time!r}*v}}",
        f'  pull: {{to: {b}, force: "{newton!r}*cos({2 / w.time!r}*t)*{rotated(w, (1, 2, 0.5))}"}}',
    ]
    rod, plane, lift = w.length, rotated(w, (0.36, 0.48, 0.8)), 1.5 / w.time**2
    height = float(np.dot((0.36, 0.48, 0.8), PLACES[2])) * w.length
    holonomic = [
        f'  {w.rows[0]}: "{w.factors[0]!r}*(dot({a}, {a}) - {rod!r}**2) = 0"',
        f'  {w.rows[1]}: "{w.factors[1]!r}*distance({a}, {b}) = {w.factors[1]!r}*{link!r}"',
        f'  {w.rows[2]}: "{w.factors[2]!r}*(dot({c}, {plane})/{w.length!r} - {height!r}'
        f' - {lift * w.length!r}*t**2/2) = 0"',
    ]
    ex, ez = rotated(w, (1, 0, 0)), rotated(w, (0, 0, 1))
    edge = f"dot({c}, {ez})*d(dot({b}, {ex})) - {w.length**2!r}*d(dot({b}, {ez}))"
    return "\n".join(
        [
            "lagcli: 1",
            "particles:",
            *(particles[i] for i in w.particle_order),
            "forces:",
            *(forces[i] for i in w.force_order),
            "holonomic:",
            *(holonomic[i] for i in w.row_order),
            "differential:",
            f'  edge: "{w.factors[3]!r}*({edge}) = 0"',
        ]
    )


def run(w):
    return lagcli.simulate(
        lagcli.loads(text(w)),
        duration=DURATION * w.time,
        samples=SAMPLES,
        rtol=1e-12,
        atol=1e-14 * min(w.length, w.length / w.time, 1.0),
    )


def vectors(table, w, kind):
    """Positions, velocities or reactions, shape (T, 3 particles, 3), back in the plain frame and units."""
    unit = {"r": w.length, "v": w.length / w.time, "R": w.mass * w.length / w.time**2}[kind]
    pattern = {"r": "{}.{}", "v": "{}.v{}", "R": "R.{}.{}"}[kind]
    columns = [[table[pattern.format(name, axis)] for axis in "xyz"] for name in w.names]
    return np.moveaxis(np.array(columns), -1, 0) @ np.array(w.frame) / unit


def close(found, expected, tolerance=1e-10):
    return bool(np.abs(found - expected).max() <= tolerance * np.abs(expected).max())


@functools.cache
def plain():
    """The run of the plain writing: its table, its vectors by kind, its multipliers by row."""
    table = run(PLAIN)
    multipliers = {row: table[f"lambda.{row}"] for row in (*PLAIN.rows, "edge")}
    return table, {kind: vectors(table, PLAIN, kind) for kind in "rvR"}, multipliers


def assert_same_physics(table, w, tolerance=1e-10):
    for kind, expected in plain()[1].items():
        assert close(vectors(table, w, kind), expected, tolerance), kind


def assert_multipliers(table, names, factors, tolerance=1e-10):
    for (row, expected), name, factor in zip(plain()[2].items(), names, factors, strict=True):
        assert close(table[f"lambda.{name}"], factor * expected, tolerance), row


def test_the_system_is_worth_writing_in_another_way():
    table, found, multipliers = plain()
    assert min(np.abs(found["R"]).max(axis=(0, 1))) > 1
    assert all(np.ptp(values) > 0.1 for values in multipliers.values())
    assert table.stats.energy_imbalance <= 1e-10


@pytest.mark.parametrize("factor", [-1.0, 3.7, 1e6, -1e-6, 1e8])
def test_factor_of_a_constraint_divides_its_multiplier_alone(factor):
    w = Writing(factors=(factor, 1.0, -factor, 2 * factor))
    table = run(w)
    assert_same_physics(table, w)
    assert_multipliers(table, (*w.rows, "edge"), (1 / factor, 1, -1 / factor, 0.5 / factor))


@FEW
@given(factors=st.tuples(*[st.floats(-5, 5).map(lambda x: 10.0**x if x > 0 else -(10.0**x))] * 4))
def test_any_factors_leave_motion_and_reactions(factors):
    w = Writing(factors=factors)
    table = run(w)
    assert_same_physics(table, w)
    assert_multipliers(table, (*w.rows, "edge"), [1 / c for c in factors])


@pytest.mark.parametrize("order", list(itertools.permutations(range(3)))[1:])
def test_order_of_particles_and_rows_is_of_no_matter(order):
    w = Writing(particle_order=order, row_order=order[::-1], force_order=(*order, 3)[::-1])
    table = run(w)
    assert_same_physics(table, w)
    assert_multipliers(table, (*w.rows, "edge"), (1, 1, 1, 1))
    written = [c.removeprefix("lambda.") for c in table.columns if c.startswith("lambda.")]
    assert written == [w.rows[i] for i in w.row_order] + ["edge"]


@pytest.mark.parametrize(
    ("names", "rows"),
    [
        (("c", "a", "b"), ("table", "rod", "link")),
        (("x", "y1", "e"), ("d", "q", "z")),
        (("_", "no", "on"), ("S", "B", "g")),
    ],
)
def test_names_are_of_no_matter(names, rows):
    w = Writing(names=names, rows=rows)
    table = run(w)
    assert_same_physics(table, w, 1e-12)
    assert_multipliers(table, (*w.rows, "edge"), (1, 1, 1, 1), 1e-12)


def turn(axis, angle):
    """The matrix of a rotation."""
    n = np.array(axis) / np.linalg.norm(axis)
    K = np.array([[0, -n[2], n[1]], [n[2], 0, -n[0]], [-n[1], n[0], 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def as_frame(matrix):
    return tuple(map(tuple, matrix.tolist()))


@FEW
@given(axis=st.tuples(*[st.floats(-1, 1)] * 2, st.floats(0.1, 1)), angle=st.floats(-3, 3))
def test_reactions_turn_with_the_frame(axis, angle):
    w = Writing(frame=as_frame(turn(axis, angle)))
    table = run(w)
    assert_same_physics(table, w)
    assert_multipliers(table, (*w.rows, "edge"), (1, 1, 1, 1))


def test_reactions_are_mirrored_with_the_frame():
    w = Writing(frame=((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)))
    assert_same_physics(run(w), w)


@pytest.mark.parametrize(
    ("length", "mass", "time"),
    [(1000.0, 1.0, 1.0), (1.0, 1000.0, 1.0), (1.0, 1.0, 60.0), (1e9, 1e3, 1e6), (1e-10, 1e-27, 1e-12)],
    ids=["millimetres", "grams", "per minute", "nano, gram, micro", "atoms"],
)
def test_reactions_scale_with_the_units(length, mass, time):
    w = Writing(length=length, mass=mass, time=time)
    table = run(w)
    assert_same_physics(table, w)
    force = mass * length / time**2
    # rod: f ~ l^2; link: f ~ l; table: f ~ l; edge: coefficients ~ l^3.
    factors = (force / length, force, force, force / length**3)
    assert_multipliers(table, (*w.rows, "edge"), factors)


def test_angles_against_particles():
    masses = "parameters: {m1: 1.4, m2: 0.6, L1: 0.8, L2: 1.1, u: 0.9, w: -0.5, s: 1.2}\n"
    forces = """
forces:
  weight: {to: all, force: [0, 0, -m*9.81]}
  wind: {to: b, force: "[2*sin(3*t), 0, 0] - 0.1*v"}
  spring: {potential: "4*distance(a, [1, 0, 0])**2/2"}
"""
    angles = f"""
lagcli: 1
{masses}
coordinates: {{u1: {{value: u, rate: s}}, w1: {{value: w}}}}
particles:
  a: {{mass: m1, position: "[L1*sin(u1), 0, -L1*cos(u1)]"}}
  b: {{mass: m2, position: "[L1*sin(u1) + L2*sin(w1), 0, -L1*cos(u1) - L2*cos(w1)]"}}
{forces}"""
    cartesian = f"""
lagcli: 1
{masses}
particles:
  a: {{mass: m1, position: [L1*sin(u), 0, -L1*cos(u)], velocity: [L1*cos(u)*s, 0, L1*sin(u)*s]}}
  b:
    mass: m2
    position: [L1*sin(u) + L2*sin(w), 0, -L1*cos(u) - L2*cos(w)]
    velocity: [L1*cos(u)*s, 0, L1*sin(u)*s]
{forces}
holonomic:
  upper: norm(a) = L1
  lower: distance(a, b) = L2
  flat_a: a.y = 0
  flat_b: b.y = 0
"""
    options = {"duration": 2, "samples": 21, "rtol": 1e-12, "atol": 1e-14}
    one, other = (lagcli.simulate(lagcli.loads(model), **options) for model in (angles, cartesian))
    for name in ("a", "b"):
        assert close(one.reaction(name), other.reaction(name))
        for part in ("x", "z", "vx", "vz"):
            assert close(one[f"{name}.{part}"], other[f"{name}.{part}"])
    assert close(one["energy"], other["energy"])


def test_spherical_angles_against_a_particle():
    start = "parameters: {m: 0.5, L: 1.2, th0: 0.8, w: 2}\n"
    weight = "forces:\n  weight: {to: a, force: [0, 0, -m*9.81]}\n"
    angles = (
        f"lagcli: 1\n{start}coordinates: {{th: {{value: th0}}, ph: {{rate: w}}}}\n"
        'particles:\n  a: {mass: m, position: "L*[sin(th)*cos(ph), sin(th)*sin(ph), -cos(th)]"}\n' + weight
    )
    cartesian = (
        f"lagcli: 1\n{start}particles:\n"
        "  a: {mass: m, position: [L*sin(th0), 0, -L*cos(th0)], velocity: [0, L*sin(th0)*w, 0]}\n"
        f"{weight}holonomic:\n  rod: norm(a) = L\n"
    )
    one, other = (
        lagcli.simulate(lagcli.loads(model), duration=3, samples=21) for model in (angles, cartesian)
    )
    assert close(one.reaction("a"), other.reaction("a"))
    # The pull of the rod is lambda itself, and the angles feel no constraint.
    radial = np.stack([other[f"a.{axis}"] for axis in "xyz"], axis=1) / 1.2
    assert close(np.sum(one.reaction("a") * radial, axis=1), other["lambda.rod"])
    assert not one["R.th"].any()
    assert not one["R.ph"].any()
