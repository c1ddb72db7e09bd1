"""The dimension of f = 0: by rank where rows are independent or redundant, by second derivatives where the rank is
below the codimension, near a special start by what is around it; never a number that is not the dimension."""

import itertools
import random
from fractions import Fraction

import numpy as np
import pytest

import lagcli
from tests.helpers import exact_rank


def joined(points, rods, unit=1.0, more=""):
    """Particles with the distances of these pairs."""
    places = unit * np.array(points, float)
    lines = ["lagcli: 1", "particles:"]
    lines += [f"  p{k}: {{mass: 1, position: {place.tolist()!r}}}" for k, place in enumerate(places)]
    lines.append("holonomic:")
    for i, j in rods:
        lines.append(f"  d{i}_{j}: distance(p{i}, p{j}) = {float(np.linalg.norm(places[i] - places[j]))!r}")
    return "\n".join(lines) + "\n" + more


def pairs(count):
    return list(itertools.combinations(range(count), 2))


def counted(text):
    return lagcli.dof(lagcli.loads(text))


def exact(points, rods):
    return exact_rank.rank(exact_rank.rigidity([tuple(map(Fraction, p)) for p in points], rods))


def counts(text):
    """3n - rows, 3n - rank, and the proved one."""
    found = counted(text)
    return found.coordinates - found.rows, found.coordinates - found.rank, found.configuration_dof


# Bodies in space: redundant rods, counted by rank.

CUBE = list(itertools.product((0, 1), repeat=3))
OCTAHEDRON = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
PRISM = [(0, 0, 0), (4, 0, 0), (1, 3, 0), (0, 0, 2), (4, 0, 2), (1, 3, 2)]
PRISM_RODS = [(0, 1), (1, 2), (0, 2), (3, 4), (4, 5), (3, 5), (0, 3), (1, 4), (2, 5)]
SKEW = [tuple(k**power % 7 for power in (1, 2, 3)) for k in range(6)]
PENTAGON = [(4, 0, 0), (1, 4, 0), (-3, 2, 0), (-3, -2, 0), (1, -4, 0)]
APEXES = [(0, 0, 3), (0, 0, -2)]
# The rim, and both apexes to all of it.
BIPYRAMID = [(k, (k + 1) % 5) for k in range(5)] + [(k, apex) for k in range(5) for apex in (5, 6)]


@pytest.mark.parametrize(
    ("points", "rods", "freedoms"),
    [
        (SKEW[:5], pairs(5), 6),
        (SKEW, pairs(6), 6),
        (CUBE, pairs(8), 6),
        (PRISM, pairs(6), 6),
        (PRISM, PRISM_RODS, 9),
        (OCTAHEDRON, [(i, j) for i, j in pairs(6) if i // 2 != j // 2], 6),
        (OCTAHEDRON, pairs(6), 6),
        ([*PENTAGON, *APEXES], BIPYRAMID, 6),
        ([*PENTAGON, *APEXES], pairs(7), 6),
        ([(0, 0, 0), (3, 0, 0), (0, 4, 0), (1, 1, 2), (1, 1, -3)], pairs(5)[:-1], 6),
    ],
    ids=[
        *["K5", "K6", "cube with all", "prism with all", "prism"],
        *["octahedron", "octahedron with all", "pentagonal bipyramid", "the same with all", "bipyramid"],
    ],
)
def test_bodies_are_counted_by_their_rank(points, rods, freedoms):
    rank = exact(points, rods)
    assert 3 * len(points) - rank == freedoms
    found = counted(joined(points, rods))
    assert (found.rank, found.configuration_dof) == (rank, freedoms)
    assert found.redundant == len(found.redundant_rows) == len(rods) - rank
    assert not found.notes


def test_square_in_its_plane_with_both_diagonals():
    text = "lagcli: 1\ncoordinates:\n"
    corners = [(0, 0), (1, 0), (1, 1), (0, 1)]
    text += "".join(
        f"  {c}{k}: {{value: {x}}}\n" for k, at in enumerate(corners) for c, x in zip("xy", at, strict=True)
    )
    text += "lagrangian: rate(x0)**2\nholonomic:\n"
    for i, j in pairs(4):
        square = (corners[i][0] - corners[j][0]) ** 2 + (corners[i][1] - corners[j][1]) ** 2
        text += f'  d{i}{j}: "(x{i} - x{j})**2 + (y{i} - y{j})**2 = {square}"\n'
    assert counts(text) == (2, 3, 3)
    assert counted(text).redundant_rows == ("d23",)


# The rank is below the codimension wherever the rows hold.


@pytest.mark.parametrize("places", [(0, 1, 3), (0, 1, 2), (-1, 0, 2, 5), (0, 1, 2, 3, 4), (0, 7, 1, 5, 3, 4)])
def test_particles_on_a_line_with_all_their_distances_have_five(places):
    points, count = [(x, 2 * x, -x) for x in places], len(places)
    assert exact(points, pairs(count)) == count - 1
    text = joined(points, pairs(count))
    assert counts(text) == (3 * count - len(pairs(count)), 2 * count + 1, 5)
    (note,) = counted(text).notes
    assert "`d0_1`" in note
    assert f"{3 * count - 5} by second derivatives, {count - 1} by rank" in note


@pytest.mark.parametrize(
    "points",
    [
        [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)],
        [(0, 0, 0), (3, 0, 1), (5, 4, 3), (0, 2, 1)],
        [(0, 0, 0), (4, 0, 0), (0, 4, 0), (1, 1, 0)],
        PENTAGON,
        [(2, 0, 0), (1, 2, 0), (-1, 2, 0), (-2, 0, 0), (-1, -2, 0), (1, -2, 0)],
        [(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0), (0, 2, 0)],
    ],
    ids=["square", "askew", "one inside", "pentagon", "hexagon", "on two lines"],
)
def test_flat_sets_with_all_their_distances_have_six(points):
    flat = [(x, y, x - y if name else z) for name, (x, y, z) in zip(itertools.repeat(points[1][2]), points)]
    count = len(points)
    assert exact(flat, pairs(count)) == 2 * count - 3
    assert counts(joined(flat, pairs(count))) == (3 * count - len(pairs(count)), count + 3, 6)


@pytest.mark.parametrize("unit", [1e-9, 1e-6, 1e-3, 1e3, 1e6])
@pytest.mark.parametrize(
    ("points", "freedoms"),
    [([(0, 0, 0), (1, 0, 0), (2.5, 0, 0)], 5), (PENTAGON[:4], 6), (SKEW[:5], 6)],
    ids=["line", "flat", "K5"],
)
def test_unit_of_length_changes_no_count(points, freedoms, unit):
    assert counted(joined(points, pairs(len(points)), unit)).configuration_dof == freedoms


@pytest.mark.parametrize(
    ("points", "rods", "freedoms"),
    [
        # Two needles with a common end, with a common part, and one that hangs on a rod.
        (
            [(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0), (0, 3, 0)],
            [(0, 1), (1, 2), (0, 2), (0, 3), (3, 4), (0, 4)],
            7,
        ),
        ([(0, 0, 0), (1, 0, 0), (2, 0, 0), (4, 0, 0)], [(0, 1), (1, 2), (0, 2), (1, 3), (0, 3)], 5),
        ([(0, 0, 0), (1, 0, 0), (2, 0, 0), (5, 5, 0)], [(0, 1), (1, 2), (0, 2), (2, 3)], 7),
        # Two flat sets that share a side.
        (
            [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (1, 0, 2), (0, 0, 2)],
            [*pairs(4), (0, 4), (1, 4), (0, 5), (1, 5), (4, 5)],
            7,
        ),
        # A cube with its four longest diagonals holds its shape by the stress in them alone (Connelly).
        (CUBE, [(i, j) for i, j in pairs(8) if i ^ j not in (3, 5, 6)], 6),
        # A needle apart from a body with a rod too many.
        ([*SKEW[:5], (9, 9, 9), (9, 9, 10), (9, 9, 12)], [*pairs(5), (5, 6), (6, 7), (5, 7)], 11),
    ],
    ids=["common end", "common part", "on a rod", "common side", "cube", "needle and body"],
)
def test_several_sets_together(points, rods, freedoms):
    found = counted(joined(points, rods))
    assert found.rank == exact(points, rods)
    assert found.configuration_dof == freedoms < 3 * len(points) - found.rank
    assert len(found.notes) == 1


def test_deficient_rows_with_a_copy():
    text = joined([(0, 0, 0), (1, 0, 0), (3, 0, 0)], pairs(3)) + "  copy: distance(p0, p1)**2 = 1\n"
    found = counted(text)
    assert counts(text) == (5, 7, 5)
    assert found.redundant_rows == ("copy",)
    assert (found.holonomic, found.redundant) == (4, 1)


# Rows that move.


def test_redundant_rods_that_grow_alike():
    text = joined([(0, 0, 0), (2, 0, 0)], []) + "  rod: distance(p0, p1) = 2 + sin(t)\n"
    text += "  twin: distance(p0, p1)**2 = (2 + sin(t))**2\n"
    assert counts(text) == (4, 5, 5)


def test_needle_that_grows_alike_and_one_that_opens():
    text = joined([(0, 0, 0), (1, 0, 0), (2, 0, 0)], [])
    text += "  ab: distance(p0, p1) = 1 + t\n  bc: distance(p1, p2) = 1 + t\n"
    assert counts(text + "  ac: distance(p0, p2) = 2 + 2*t\n") == (6, 7, 5)
    # A triangle from now on: nothing is said of six, nor of five.
    assert counted(text + "  ac: distance(p0, p2) = 2 + 2*t - t**2\n").configuration_dof in (None, 6)


# Generalized coordinates.


def rows_of(*laws, start=(0, 0, 0)):
    values = ", ".join(f"{name}: {{value: {value}}}" for name, value in zip("xyz", start, strict=True))
    text = f"lagcli: 1\ncoordinates: {{{values}}}\nlagrangian: rate(x)**2 + rate(y)**2 + rate(z)**2\nholonomic:\n"
    return text + "".join(f'  r{k}: "{law}"\n' for k, law in enumerate(laws))


PROVED = {
    "x**2 = 0": 2,
    "x**2 + y**2 = 0": 1,
    "(x - y)**2 + (z - sin(x))**2 = 0": 1,
    "x**2 + y**2 + z**2 = 0": 0,
    "2 - cos(x) - cos(y) = 0": 1,
    "x = 0; x + y**2 = 0": 1,
    "x = 0; x + 1e-9*y**2 = 0": 1,
    "x = 0; x + (y - z**2)**2 = 0": 1,
    "x + y**2 = 0; x - z**2 = 0; x + y**2 + z**2 = 0": 0,
    "x*y = 0": 2,
    "x**2 = y**2; z = 0": 1,
    "y**2 = x**3": 2,
    "x**2 + y**2 = z**2": 2,
}


@pytest.mark.parametrize("laws", PROVED)
def test_squares_and_crossings_are_counted(laws):
    assert counted(rows_of(*laws.split("; "))).configuration_dof == PROVED[laws]


# Surfaces of which second derivatives do not tell the dimension, or on which several dimensions meet.
UNPROVED = {
    "x**2 + y**4 = 0": 1,
    "x**3 = 0": 2,
    "x = 0; x + y**4 = 0": 1,
    "x = 0; x + y**6 + z**6 = 0": 0,
    "x = 0; x + (y/1000)**4 = 0": 1,
    "x = 0; x + 1e-14*y**4 = 0": 1,
    "y = x**2; y = x**2 + x**6": 1,
    "y = sin(x); y = sin(x) + 1e-10*x**2": 1,
    "y = cos(x); y = 1 - x**2/2 + x**4/24 - x**6/720": 1,
    "y**2 + x**4 = x**5": 1,
    "x*z = 0; y*z = 0": 2,
    "z**2*x = 0; z**2*y = 0": 2,
    "x*(z - x**2) = 0; y*(z - x**2) = 0": 2,
    "z*(x**2 + y**2) = 0": 2,
    "(z - x**2 - y**2)*x = 0; (z - x**2 - y**2)*z = 0": 2,
    "x = 0; x + y*z = 0; x + y**2 - z**2 = 0": 0,
}


@pytest.mark.parametrize("laws", UNPROVED)
def test_what_is_not_proved_is_no_number(laws):
    text = rows_of(*laws.split("; ")).replace(
        "y: {value: 0}", "y: {value: 1}" if "cos(x)" in laws else "y: {}"
    )
    found = counted(text)
    assert found.configuration_dof in (None, UNPROVED[laws])
    low, high = found.bounds
    assert low <= UNPROVED[laws] <= high
    assert (found.proof == "none") == (found.configuration_dof is None)


def test_planes_and_lines_that_meet_askew_get_no_wrong_number():
    dice = np.random.default_rng(7)
    for _ in range(12):
        axes = np.linalg.qr(dice.standard_normal((3, 3)))[0] * [[1], [1], [10 ** dice.uniform(-2, 2)]]
        a, b, c = (f"({float(u)!r}*x + {float(v)!r}*y + {float(w)!r}*z)" for u, v, w in axes)
        for laws, truth in (
            ((f"{a}*{c} = 0", f"{b}*{c} = 0"), 2),
            ((f"{c}**2*{a} = 0", f"{c}**2*{b} = 0"), 2),
            ((f"({c} - {a}**2)*{a} = 0", f"({c} - {a}**2)*{c} = 0"), 2),
            ((f"{a}*{b} = 0", f"{c} = 0"), 1),
        ):
            assert counted(rows_of(*laws)).configuration_dof in (None, truth)


@pytest.mark.parametrize("windows", [1, 2, 3])
def test_level_windows_of_parallelograms_get_no_wrong_number(windows):
    names = [f"{axis}{k}" for k in range(windows + 1) for axis in "xz"]
    text = "lagcli: 1\ncoordinates:\n"
    text += "".join(f"  {name}: {{value: {int(name[1:]) + 1 if name[0] == 'x' else 0}}}\n" for name in names)
    text += "lagrangian: " + " + ".join(f"rate({name})**2" for name in names) + "\nholonomic:\n"
    for k in range(windows + 1):
        text += f'  crank{k}: "(x{k} - {k})**2 + z{k}**2 = 1"\n'
    for k in range(windows):
        text += f'  coupler{k}: "(x{k + 1} - x{k})**2 + (z{k + 1} - z{k})**2 = 1"\n'
    found = counted(text)
    assert found.start_rank == windows + 1
    assert found.configuration_dof in ((1,) if windows == 1 else (1, None))


# Random frameworks on a grid, where many are special.


@pytest.mark.parametrize("seed", range(4))
def test_random_frameworks_are_counted_within_their_exact_rank(seed):
    dice = random.Random(seed)
    grid = list(itertools.product(range(3), repeat=3))
    proved = 0
    for _ in range(12):
        points = dice.sample(grid if seed % 2 else grid[::3], dice.randint(3, 5))
        rods = dice.sample(pairs(len(points)), dice.randint(len(points) - 1, len(pairs(len(points)))))
        rank = exact(points, rods)
        free = 3 * len(points) - rank
        found = counted(joined(points, rods))
        if rank == len(rods) or rank == exact_rank.generic_rank(len(points), 3, rods):
            assert found.configuration_dof == free
        elif found.configuration_dof is not None:
            # A needle with a point on two of its ends has fewer freedoms than 3N - rows: 6 of 12 - 5.
            assert 5 <= found.configuration_dof <= free
        proved += found.configuration_dof is not None
    assert proved >= 10


# Which multipliers are unique.


def flags(text):
    report = lagcli.check(lagcli.loads(text))
    return {row.name: row.unique for row in report.constraints}, report.null_vectors


def test_null_vectors_have_exact_weights():
    points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    held = "".join(f"  q{k}: p{k}.z = 0\n" for k in range(4))
    unique, vectors = flags(joined(points, pairs(4)) + held)
    assert {name for name, flag in unique.items() if flag} == {f"q{k}" for k in range(4)}
    (vector,) = vectors
    # The sides pull by 1 while the diagonals push by sqrt(2).
    force = dict(zip(vector.rows, vector.weights, strict=True))
    for side in ("d0_1", "d1_2", "d2_3", "d0_3"):
        assert force[side] / force["d0_2"] == pytest.approx(-1 / np.sqrt(2), abs=1e-12)
    assert force["d1_3"] / force["d0_2"] == pytest.approx(1, abs=1e-12)


def test_multipliers_are_unique_near_a_start_where_rows_are_dependent_at_that_point_alone():
    text = """
lagcli: 1
particles:
  a: {mass: 1, position: [1, 0, 0]}
  b: {mass: 1, position: [3, 0, 0]}
holonomic:
  crank: norm(a) = 1
  other: distance(b, [2, 0, 0]) = 1
  coupler: distance(a, b) = 2
  flat: a.z = 0
  level: b.z = 0
"""
    unique, vectors = flags(text)
    assert all(unique.values())
    assert not vectors


def test_row_that_makes_no_force_has_no_unique_multiplier():
    text = """
lagcli: 1
coordinates: {p: {value: 0.5}, q: {value: -0.5}}
particles:
  a: {mass: 1, position: "[sin(p), 0, -cos(p)]"}
  b: {mass: 1, position: "[2*sin(0.5) + sin(q), 0, -cos(q)]"}
holonomic: {close: a = b}
"""
    unique, vectors = flags(text)
    assert unique == {"close.x": True, "close.y": False, "close.z": True}
    assert [vector.rows for vector in vectors] == [("close.y",)]


def test_rows_of_a_rigid_body_share_forces_with_distances_in_it():
    text = (
        joined([(0, 0, 0), (1, 0, 0), (0, 2, 0), (1, 2, 3)], [(0, 1)]) + "rigid: {body: [p0, p1, p2, p3]}\n"
    )
    unique, vectors = flags(text)
    assert unique["d0_1"] is False
    (vector,) = vectors
    assert "d0_1" in vector.rows
    assert all(name == "d0_1" or name.startswith("body.") for name in vector.rows)
    assert {name for name, flag in unique.items() if not flag} == set(vector.rows)


def test_many_rows_are_flagged_from_sparse_factors():
    square = "1 + (sin(i) - sin(i - 1))**2 + (cos(2*i) - cos(2*(i - 1)))**2"
    text = f"""
lagcli: 1
particles:
  p[i]: {{for: "i = 1..90", mass: i, position: "[i, sin(i), cos(2*i)]"}}
holonomic:
  rod[i]: {{for: "i = 2..90", equation: "distance(p[i-1], p[i])**2 = {square}"}}
  twin[i]: {{for: "i = 10..80", equation: "dot(p[i] - p[i-1], p[i] - p[i-1]) = {square}"}}
"""
    unique, vectors = flags(text)
    assert len(unique) == 160
    shared = {f"{kind}[{i}]" for kind in ("rod", "twin") for i in range(10, 81)}
    assert {name for name, flag in unique.items() if not flag} == shared
    assert {vector.rows for vector in vectors} == {(f"rod[{i}]", f"twin[{i}]") for i in range(10, 81)}
    assert all(np.allclose(vector.weights, (1, -1)) for vector in vectors)
    count = counted(text)
    assert count.redundant_rows == tuple(f"twin[{i}]" for i in range(10, 81))
    assert count.configuration_dof == 270 - 89


@pytest.mark.parametrize(
    ("laws", "freedoms"),
    [
        (("z = x**2 + y**2 - 1e-8*x", "z = 0"), 1),
        (("z = x**2 + y**2 - 1e-10*x", "z = 0"), 1),
        (("z = x**2 + y**2 - 1e-12*x", "z = 0"), 1),
        (("z = x**2 + y**2 + 1e-11*y", "z = 0"), 1),
        (("z = 3*x**2 + y**2/7 - 1e-9*y", "z = 0"), 1),
        (("z = x**2 + y**2", "z = 0"), 0),
        (("z = 3*x**2 + y**2/7", "z = 0"), 0),
    ],
)
def test_small_curves_through_the_start_are_no_points(laws, freedoms):
    rows = "".join(f"  h{k}: {law}\n" for k, law in enumerate(laws))
    found = counted(
        "lagcli: 1\ncoordinates: {x: {value: 0}, y: {value: 0}, z: {value: 0}}\n"
        "lagrangian: (rate(x)**2 + rate(y)**2 + rate(z)**2)/2\nholonomic:\n" + rows
    )
    assert found.configuration_dof == freedoms
    assert (found.reason == "") == (freedoms is not None)
