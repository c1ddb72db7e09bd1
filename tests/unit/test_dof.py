"""Degrees of freedom by ranks: counts, redundant and contradictory rows, and counts that stay open."""

import itertools

import numpy as np
import pytest

import lagcli
from lagcli.errors import diagnostics
from lagcli.linear import metric_rows
from tests.helpers import reference_models, spent

pytestmark = pytest.mark.numeric

FRAMEWORKS = reference_models.frameworks()


def framework(points, edges, anchors=(), dimension=3, factor=lambda i: 1.0):
    """Points of which the edges, and the links (point, fixed place) of `anchors`, keep their lengths."""
    axes = "xyz"[:dimension]
    points = np.array(points, float)
    names = [f"{axis}{k}" for k in range(len(points)) for axis in axes]
    values = dict(zip(names, points.ravel().tolist(), strict=True))
    laws = []
    for i, j in edges:
        square = "+".join(f"({axis}{i}-{axis}{j})**2" for axis in axes)
        laws.append((square, float(np.sum((points[i] - points[j]) ** 2))))
    for k, place in anchors:
        square = "+".join(f"({axis}{k}-({float(x)!r}))**2" for axis, x in zip(axes, place, strict=True))
        laws.append((square, float(np.sum((points[k] - place) ** 2))))
    lines = ["lagcli: 1", "coordinates:"]
    lines += [f"  {name}: {{value: {value!r}}}" for name, value in values.items()]
    lines += ["lagrangian: " + " + ".join(f"rate({name})**2/2" for name in names), "holonomic:"]
    for n, (left, right) in enumerate(laws, 1):
        lines.append(f'  e{n}: "{factor(n)!r}*({left} - {right!r}) = 0"')
    return "\n".join(lines) + "\n"


def counted(text):
    return lagcli.dof(lagcli.loads(text))


def complete(n):
    return list(itertools.combinations(range(n), 2))


TETRAHEDRON = [[0, 0, 0], [1, 0, 0], [0.5, 0.9, 0], [0.5, 0.3, 0.8]]
CUBE = [[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]
CUBE_EDGES = [
    (i, j) for i, j in complete(8) if sum(a != b for a, b in zip(CUBE[i], CUBE[j], strict=True)) == 1
]


def four_bars(n, angle):
    """n windows: n + 1 cranks of length one on the ground points (k, 0), joined by couplers of length one."""
    tips = [[k + np.cos(angle), np.sin(angle)] for k in range(n + 1)]
    couplers = [(k, k + 1) for k in range(n)]
    return tips, couplers, [(k, (float(k), 0.0)) for k in range(n + 1)]


def parallelogram(angle):
    """Cranks of length one on (0, 0) and (2, 0), and a coupler of length two."""
    tips = [[np.cos(angle), np.sin(angle)], [2 + np.cos(angle), np.sin(angle)]]
    return tips, [(0, 1)], [(0, (0.0, 0.0)), (1, (2.0, 0.0))]


KNOWN = {
    "K3 triangle": framework(TETRAHEDRON[:3], complete(3)),
    "K4 tetrahedron": framework(TETRAHEDRON, complete(4)),
    "K5 (tet+centroid)": framework([*TETRAHEDRON, np.mean(TETRAHEDRON, axis=0)], complete(5)),
    "cube 12 edges only": framework(CUBE, CUBE_EDGES),
    "parallelogram four-bar ph=1": framework(*parallelogram(1.0), dimension=2),
    "N-four-bar N=1 ph=0.300": framework(*four_bars(1, 0.3), dimension=2),
    "N-four-bar N=2 ph=0.300": framework(*four_bars(2, 0.3), dimension=2),
    "triangle of 3 particles, one on a sphere": framework(
        [[3, 4, 0], [6, 4, 0], [4.5, 4, np.sqrt(27) / 2]], complete(3), [(0, (0.0, 0.0, 0.0))]
    ),
}


def test_every_framework_of_the_data_is_counted():
    assert set(KNOWN) == set(FRAMEWORKS)


@pytest.mark.parametrize("name", KNOWN)
def test_ranks_of_known_frameworks(name):
    expected, found = FRAMEWORKS[name], counted(KNOWN[name])
    assert found.coordinates == expected["coords"]
    assert found.holonomic == found.start_rank == expected["rank"]
    assert found.redundant == expected["constraints"] - expected["rank"]
    assert found.configuration_dof == found.velocity_dof == expected["velocity_dof"]
    assert len(found.redundant_rows) == found.redundant


# Redundant rows.

TWINS = """
lagcli: 1
particles:
  a: {mass: 1, position: [0, 0, 0]}
  b: {mass: 2, position: [1, 2, 2]}
  c: {mass: 1, position: [5, 0, 0]}
holonomic:
  rod: distance(a, b) = 3
  stay: c.x - a.x = 5
  twin: dot(a - b, a - b)/9 = 1
"""


def test_twin_rods_count_once_and_are_named():
    found = counted(TWINS)
    assert (found.holonomic, found.redundant, found.configuration_dof) == (2, 1, 7)
    assert found.redundant_rows == ("twin",)
    report = lagcli.check(lagcli.loads(TWINS))
    assert [c.verdict.row for c in report.constraints if c.redundant] == ["twin"]


def test_every_row_that_follows_is_named_but_the_first_of_its_kind_is_not():
    more = TWINS + "  sum: c.x + b.z = a.x + b.z + 5\n  third: norm(a - b)**3 = 27\n"
    found = counted(more)
    assert found.configuration_dof == 7
    assert found.redundant_rows == ("twin", "sum", "third")


def test_differential_row_of_a_declared_constraint_is_redundant():
    text = TWINS.replace("  twin: dot(a - b, a - b)/9 = 1\n", "") + (
        "differential:\n  same: dot(a - b, a.v - b.v) = 0\n  other: rate(c.y) = 0\n"
    )
    found = counted(text)
    assert (found.holonomic, found.nonholonomic, found.redundant) == (3, 0, 1)
    assert found.redundant_rows == ("same",)
    assert found.configuration_dof == 6


@pytest.mark.parametrize("law", ["distance(a, b) = 2", "dot(a - b, a - b) = 9.0001", "norm(a - b) + 1 = 0"])
def test_contradictory_rows_are_refused(law):
    text = TWINS.replace("dot(a - b, a - b)/9 = 1", law)
    for question in (lagcli.dof, lagcli.check, lagcli.simulate):
        with pytest.raises(lagcli.ModelError) as refused:
            question(lagcli.loads(text))
        assert any("twin" in diagnostic.message for diagnostic in refused.value.diagnostics)


# Ranks that prove nothing: see also `test_codimension`.

PLANE = "lagcli: 1\ncoordinates: {x: {}, y: {}}\nlagrangian: rate(x)**2 + rate(y)**2\n"


@pytest.mark.parametrize(
    ("text", "truth"),
    [
        (PLANE + "holonomic: {p: x**4 + y**2}\n", 0),
        (PLANE + "holonomic: {p: x**3}\n", 1),
        (PLANE + "holonomic: {p: x = 0, r: x + (y/1000)**4 = 0}\n", 0),
        (PLANE.replace("y: {}", "y: {}, z: {}") + "holonomic: {p: x*z = 0, r: y*z = 0}\n", 2),
    ],
    ids=[
        "a point of fourth order",
        "a line as a cube",
        "a touch of fourth order",
        "a plane and a line that crosses it",
    ],
)
def test_count_stays_open_where_neither_rank_nor_second_derivatives_prove_it(text, truth):
    found = counted(text)
    assert found.configuration_dof is None
    assert found.holonomic is None
    assert found.proof == "none"
    assert found.reason
    assert found.bounds[0] <= truth <= found.bounds[1]


def test_open_count_is_never_a_number_in_the_report():
    text = PLANE + "holonomic: {p: x**3}\n"
    report = lagcli.check(lagcli.loads(text))
    assert report["dof"]["configuration_dof"] is None
    assert report["dof"]["proof"] == "none"


@pytest.mark.parametrize("angle", [0.0, np.pi])
def test_parallelogram_at_its_crossing_counts_one_and_says_that_the_start_is_special(angle):
    found = counted(framework(*parallelogram(angle), dimension=2))
    assert found.configuration_dof == 1
    assert found.start_rank == 2
    assert any("special configuration" in note for note in found.notes)


# Scales.


@pytest.mark.parametrize(
    "spread",
    [lambda i: 1e8, lambda i: 1e-8, lambda i: 10.0 ** (8 * (-1) ** i), lambda i: -(7.0**i)],
    ids=["large", "small", "from 1e-8 to 1e8", "powers of -7"],
)
@pytest.mark.parametrize("name", ["K4 tetrahedron", "K5 (tet+centroid)", "cube 12 edges only"])
def test_scale_of_a_row_changes_no_count(name, spread):
    points, edges = {
        "K4 tetrahedron": (TETRAHEDRON, complete(4)),
        "K5 (tet+centroid)": ([*TETRAHEDRON, np.mean(TETRAHEDRON, axis=0)], complete(5)),
        "cube 12 edges only": (CUBE, CUBE_EDGES),
    }[name]
    found = counted(framework(points, edges, factor=spread))
    assert found.configuration_dof == FRAMEWORKS[name]["velocity_dof"]
    assert found.redundant == FRAMEWORKS[name]["constraints"] - FRAMEWORKS[name]["rank"]


@pytest.mark.parametrize(
    "unit", [1e9, 1e-9, 1 / 1.495978707e11, 1e-15], ids=["nanometre", "giga", "au", "peta"]
)
@pytest.mark.parametrize(
    "name", ["K4 tetrahedron", "K5 (tet+centroid)", "parallelogram four-bar ph=1", "on a line"]
)
def test_unit_of_length_changes_no_count(name, unit):
    def scaled(points):
        return (np.array(points) * unit).tolist()

    tips, coupler, grounds = parallelogram(1.0)
    text, expected = {
        "K4 tetrahedron": (framework(scaled(TETRAHEDRON), complete(4)), 6),
        "K5 (tet+centroid)": (
            framework(scaled([*TETRAHEDRON, np.mean(TETRAHEDRON, axis=0)]), complete(5)),
            6,
        ),
        "parallelogram four-bar ph=1": (
            framework(
                scaled(tips), coupler, [(k, np.multiply(place, unit)) for k, place in grounds], dimension=2
            ),
            1,
        ),
        "on a line": (framework(scaled([[0, 0, 0], [1, 0, 0], [2.5, 0, 0]]), complete(3)), 5),
    }[name]
    assert counted(text).configuration_dof == expected


@pytest.mark.parametrize("mass", [1e-27, 1e30])
def test_unit_of_mass_and_unequal_masses_change_no_count(mass):
    text = TWINS.replace("mass: 2", f"mass: {mass}")
    assert counted(text).configuration_dof == 7
    assert counted(text.replace("mass: 1,", f"mass: {mass},")).configuration_dof == 7


@pytest.mark.parametrize("factor", [1.0, 1e13, 1e-13])
def test_rows_of_unlike_dimension_are_independent_at_any_scale(factor):
    # In small units the gradient of a cubic law is smaller than that of a distance by many orders.
    text = f"""
lagcli: 1
particles:
  a: {{mass: 1, position: [1, 1, 1]}}
  b: {{mass: 1, position: [1, 1, 0]}}
holonomic:
  rod: distance(a, b) = 1
  cubic: "{factor!r}*(a.x*a.y*a.z - 1) = 0"
"""
    assert counted(text).configuration_dof == 4
    run = lagcli.simulate(lagcli.loads(text), duration=0.1, samples=2)
    assert run.t[-1] == 0.1


# Generalized coordinates.


@pytest.mark.parametrize("mean", [0.0, 0.7, 1e6, np.pi / 2])
def test_angles_are_counted_wherever_they_stand(mean):
    text = f"""
lagcli: 1
coordinates: {{u: {{value: {mean}}}, w: {{value: {mean}}}, s: {{value: 0}}}}
particles:
  a: {{mass: 1, position: "[sin(u), 0, -cos(u)]"}}
  b: {{mass: 1, position: "[sin(u) + sin(w), s, -cos(u) - cos(w)]"}}
holonomic:
  locked: u - w = 0
"""
    found = counted(text)
    assert (found.coordinates, found.configuration_dof) == (3, 2)


def test_crank_and_slider_in_angles():
    text = """
lagcli: 1
coordinates: {u: {value: pi/2}, p: {value: -pi/6}, x: {value: sqrt(3)/2}}
lagrangian: rate(u)**2 + rate(p)**2 + rate(x)**2
holonomic:
  along: x = cos(p) + cos(u)/2
  across: sin(p) + sin(u)/2 = 0
"""
    assert counted(text).configuration_dof == 1


def test_count_is_taken_at_the_nearest_consistent_configuration():
    off = TWINS.replace("position: [1, 2, 2]", "position: [1.2, 2, 2.1]")
    assert counted(off).configuration_dof == 7


@pytest.mark.parametrize(
    ("law", "expected"),
    [
        ("d(x) - 2*d(y) = 0", (2, 2)),
        ("y*d(x) + x*d(y) + dt = 0", (2, 2)),
        ("d(z) - y*d(x) = 0", (3, 2)),
    ],
    ids=["exact", "rheonomic", "contact"],
)
def test_one_differential_row(law, expected):
    text = f"""
lagcli: 1
coordinates: {{x: {{value: 1}}, y: {{value: 2}}, z: {{value: 3}}}}
lagrangian: (rate(x)**2 + rate(y)**2 + rate(z)**2)/2
differential:
  row: {law}
"""
    found = counted(text)
    assert (found.configuration_dof, found.velocity_dof) == expected


@pytest.mark.parametrize("name", reference_models.systems())
def test_reference_systems(name):
    system = reference_models.systems()[name]
    report = lagcli.check(lagcli.loads(reference_models.as_forms(system)))
    found, time = report.dof, "t" in system["coords"]
    assert found.coordinates == len(system["coords"]) - time
    assert found.holonomic == system["holonomic_count"]
    assert found.nonholonomic == system["rank"] - system["holonomic_count"]
    assert found.proof == "symbolic"
    assert list(report.joint.derived_flag) == system["derived_flag"]
    assert list(report.joint.growth_vector) == system["growth"]
    assert report.joint.is_bracket_generating == (system["holonomic_count"] == 0)
    kinds = [c.verdict.kind for c in report.constraints]
    assert [kind in ("exact", "integrable") for kind in kinds] == system["each_integrable"]


def test_integrable_rows_that_depend_on_each_other_count_once():
    system = reference_models.systems()["pfaff_rank_drop"]
    found = counted(reference_models.as_forms(system))
    assert (found.holonomic, found.redundant) == (1, 1)


def test_triangle_on_a_sphere_has_five():
    assert counted(KNOWN["triangle of 3 particles, one on a sphere"]).configuration_dof == 5


def test_nonholonomic_row_beside_a_surface():
    # On the plane z = 0 the contact row y dx = dz turns into y dx = 0: integrable there.
    text = """
lagcli: 1
coordinates: {x: {value: 1}, y: {value: 2}, z: {}}
lagrangian: (rate(x)**2 + rate(y)**2 + rate(z)**2)/2
holonomic: {flat: z = 0}
differential: {row: d(z) - y*d(x) = 0}
"""
    found = counted(text)
    assert (found.configuration_dof, found.velocity_dof, found.redundant) == (1, 1, 0)
    skate = (
        text.replace("{z: {}", "{w: {}, z: {}")
        .replace("z: {}}", "z: {}, w: {value: 0.4}}")
        .replace("rate(z)**2)", "rate(z)**2 + rate(w)**2)")
        .replace("d(z) - y*d(x)", "sin(w)*d(x) - cos(w)*d(y)")
    )
    assert counted(skate).configuration_dof == 3


@pytest.mark.parametrize(
    "coefficient",
    [
        "1.0000001**1e9*a.y",
        "a.x**1e9*a.y",
        "((a.x**9)**9)**9*a.y",
        "a.y/" + "3" * 5000 + "e-5000",
        "(" + " + ".join(["a.x*a.y"] * 3000) + ")",
        "many",
    ],
)
def test_a_form_too_large_for_exact_algebra_is_undecided_at_once(coefficient):
    chain = "".join(f", d{i}: sin(d{i - 1}) + d{i - 1}*a.y" for i in range(1, 30))
    text = (
        "lagcli: 1\nparticles: {a: {mass: 1, position: [1, 0.5, 0.25]}}\n"
        f"definitions: {{d0: a.x*a.y{chain}, many: d29 + 1}}\n"
        f'differential: {{w: "d(a.z) - {coefficient}*d(a.x)", u: d(a.y)}}\n'
    )
    with spent.at_most(300_000):
        verdicts = [c.verdict for c in lagcli.check(lagcli.loads(text)).constraints]
    assert verdicts[1].kind == "exact"
    assert verdicts[0].integral is None
    assert verdicts[0].proof != "symbolic"


def test_a_number_below_the_smallest_double_is_refused_and_zero_is_none():
    text = (
        "lagcli: 1\nparticles: {{a: {{mass: 1, position: [1, 0.5, 0.25]}}}}\n"
        "differential: {{w: d(a.z) - {number}*a.y*d(a.x)}}\n"
    )
    with pytest.raises(diagnostics.ModelError, match="smaller than 4\\.9e-324"):
        lagcli.loads(text.format(number="1e-99999999"))
    verdict = lagcli.check(lagcli.loads(text.format(number="0e-99999999"))).constraints[0].verdict
    assert (verdict.kind, verdict.integral) == ("exact", "a.z")


@pytest.mark.parametrize("action", [lagcli.dof, lagcli.check])
@pytest.mark.parametrize(
    "rows",
    ["holonomic: {u: a.x = t, w: a.x = sin(t)}", "differential: {u: a.vx = 1, w: a.vx = 1 + t}"],
)
def test_rows_that_prescribe_different_motions_are_refused(action, rows):
    text = f"lagcli: 1\nparticles: {{a: {{mass: 1, position: [0, 0, 0], velocity: [1, 0, 0]}}}}\n{rows}\n"
    with pytest.raises(lagcli.ModelError) as caught:
        action(lagcli.loads(text))
    assert caught.value.diagnostics[0].code == "contradictory-constraints"


def test_moving_rows_that_agree_are_redundant():
    text = """
lagcli: 1
particles: {a: {mass: 1, position: [0, 0, 0], velocity: [1, 0, 0]}}
holonomic: {u: a.x = sin(t), w: 2*a.x - sin(t) = a.x}
"""
    found = lagcli.dof(lagcli.loads(text))
    assert (found.configuration_dof, found.redundant_rows) == (2, ("w",))


def test_a_component_that_says_nothing_is_redundant():
    text = """
lagcli: 1
coordinates: {p: {value: 0.5}, q: {value: -0.5}}
particles:
  a: {mass: 1, position: "[sin(p), 0, -cos(p)]"}
  b: {mass: 1, position: "[2*sin(0.5) + sin(q), 0, -cos(q)]"}
holonomic: {close: a = b}
"""
    found = lagcli.dof(lagcli.loads(text))
    assert (found.configuration_dof, found.redundant_rows) == (0, ("close.y",))


@pytest.mark.parametrize("law", ["norm(a - [3, 0, 1]) = 0", "norm(a - [3, 0, 1])**2 = 0"])
def test_the_tip_of_a_cone_is_undecided(law):
    text = f'lagcli: 1\nparticles: {{a: {{mass: 1, position: [1, 0, 0]}}}}\nholonomic: {{rod: "{law}"}}\n'
    assert lagcli.dof(lagcli.loads(text)).configuration_dof is None


def test_small_bodies_far_from_the_origin_are_counted():
    text = """
lagcli: 1
particles:
  a: {mass: 1, position: [1.5e11, 0, 0]}
  b: {mass: 1, position: [150000000010, 0, 0]}
holonomic: {rod: "distance(a, b) = 10"}
"""
    assert lagcli.dof(lagcli.loads(text)).configuration_dof == 5


@pytest.mark.parametrize("twins", [0, 1, 5])
def test_many_rows_are_counted_from_sparse_factors(twins, monkeypatch):
    """The same count and the same names, whether the rows are looked at densely or not."""
    text = (
        "lagcli: 1\nparameters: {N: 12, K: 0}\nparticles:\n"
        '  p[i]: {for: "i = 1..N", mass: i, position: "[i, sin(i), cos(2*i)]"}\n'
        "holonomic:\n"
        '  rod[i]: {for: "i = 2..N", equation: "distance(p[i-1], p[i]) = sqrt(1 + (sin(i) - sin(i - 1))**2'
        ' + (cos(2*i) - cos(2*(i - 1)))**2)"}\n'
        '  twin[i]: {for: "i = 2..K+1", equation: "dot(p[i] - p[i-1], p[i] - p[i-1]) = 1 + (sin(i) - sin(i - 1))**2'
        ' + (cos(2*i) - cos(2*(i - 1)))**2"}\n'
    )
    model = lagcli.loads(text, {"K": twins})
    dense = lagcli.dof(model)
    monkeypatch.setattr(metric_rows.MetricRowsParameters, "dense", 3)
    sparse = lagcli.dof(model)
    assert sparse.configuration_dof == dense.configuration_dof == 36 - 11
    assert sparse.redundant == dense.redundant == twins
    assert sparse.redundant_rows == dense.redundant_rows
