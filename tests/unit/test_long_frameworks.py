"""Over-braced frameworks of any length have one count: that of their rank, which a second way of computing gives."""

import math

import numpy as np
import pytest

import lagcli
from lagcli.linear import independent_rows, metric_rows
from lagcli.linear.metric import Metric
from lagcli.linear.metric_rows import MetricRows
from lagcli.start import precise_rows

pytestmark = pytest.mark.numeric


def text(points, rods):
    """Particles with all rods between them; those of a plane stay in it."""
    places = np.array([(p[0], 0.0, p[1]) if len(p) == 2 else p for p in points])
    lines = ["lagcli: 1", "particles:"]
    lines += [f"  p{k}: {{mass: 1, position: {place.tolist()!r}}}" for k, place in enumerate(places)]
    lines.append("holonomic:")
    lines += [f'  y{k}: "p{k}.y = 0"' for k, p in enumerate(points) if len(p) == 2]
    for n, (i, j) in enumerate(rods):
        length = float(np.linalg.norm(places[i] - places[j]))
        lines.append(f'  e{n}: "distance(p{i}, p{j}) = {length!r}"')
    return "\n".join(lines) + "\n"


def freedoms_by_rank(points, rods):
    points = np.array(points)
    rows = np.zeros((len(rods), *points.shape))
    for row, (i, j) in zip(rows, rods, strict=True):
        row[i], row[j] = points[i] - points[j], points[j] - points[i]
    return points.size - np.linalg.matrix_rank(rows.reshape(len(rods), -1), tol=1e-6)


def ladder(bays, without=(), ends=None):
    """Bays with both diagonals, some `without` any; closed to a ring of a radius where `ends` is one."""
    n = bays + (ends is None)
    if ends is None:
        points = [(float(i), float(side)) for side in (0, 1) for i in range(n)]
    else:
        angles = [2 * math.pi * i / n for i in range(n)]
        points = [
            ((ends + side) * math.cos(a), (ends + side) * math.sin(a)) for side in (0, 1) for a in angles
        ]
    rods = [(i, n + i) for i in range(n)]
    for i in range(bays):
        j = (i + 1) % n
        rods += [(i, j), (n + i, n + j)]
        rods += [(i, n + j), (j, n + i)] if i not in without else []
    return points, rods


def jiggled(points, rods):
    random = np.random.default_rng(1)
    return [tuple(np.array(p) + 0.1 * random.standard_normal(len(p))) for p in points], rods


def flat(points, rods, height):
    """As near to dependent rows as a longer one: it hardly resists to bending."""
    return [(x, height * y) for x, y in points], rods


def tower(floors):
    """Three legs, every face with both diagonals."""
    points = [
        (math.cos(2 * math.pi * c / 3 + 0.2 * i), math.sin(2 * math.pi * c / 3 + 0.2 * i), 1.1 * i)
        for i in range(floors + 1)
        for c in range(3)
    ]
    rods = [(3 * i + c, 3 * i + (c + 1) % 3) for i in range(floors + 1) for c in range(3)]
    return points, rods + [
        (3 * i + c, 3 * i + 3 + d) for i in range(floors) for c in range(3) for d in range(3)
    ]


@pytest.mark.parametrize(
    "framework",
    [
        ladder(10),
        ladder(30),
        ladder(100),
        jiggled(*ladder(40)),
        ladder(36, without=range(0, 36, 3)),
        jiggled(*ladder(36, without=range(0, 36, 3))),
        ladder(40, ends=6.0),
        ladder(70, ends=10.0),
        jiggled(*ladder(70, ends=10.0, without=(3, 30, 50))),
        tower(20),
        tower(40),
        flat(*ladder(200), 0.008),
    ],
)
def test_the_length_of_a_framework_leaves_its_count_as_it_is(framework):
    count = lagcli.dof(lagcli.loads(text(*framework)))
    points, rods = framework
    expected = freedoms_by_rank(points, rods)
    assert (count.configuration_dof, count.proof, count.reason) == (expected, "numeric", "")
    assert count.redundant == len(rods) - (np.array(points).size - expected)
    assert len(count.redundant_rows) == count.redundant


def test_a_long_framework_that_is_special_gets_no_wrong_number():
    """A flat knee in a rod of a long ladder: its rank is lower there, and no count by rank is true."""
    points, rods = ladder(60)
    points = [*points, (0.5, 0.0)]
    rods = [*rods, (0, len(points) - 1), (1, len(points) - 1)]
    assert lagcli.dof(lagcli.loads(text(points, rods))).configuration_dof in (None, 3)
    assert freedoms_by_rank(points, rods) == 4
    # Three gaps in a ring whose rods meet askew where they are not all tangents and chords.
    special, general = (
        ladder(70, ends=10.0, without=(3, 30, 50)),
        jiggled(*ladder(70, ends=10.0, without=(3, 30, 50))),
    )
    assert (freedoms_by_rank(*special), freedoms_by_rank(*general)) == (4, 3)
    assert lagcli.dof(lagcli.loads(text(*special))).configuration_dof in (None, 3)


def test_of_many_rows_those_that_span_most_are_independent(monkeypatch):
    monkeypatch.setattr(metric_rows, "are_many", lambda *_: True)
    for weight, is_swapped in ((3.0, False), (5.0, True)):
        found = independent_rows.Dependence((0, 1), (2,), ({0: weight, 1: 1.0},))
        assert independent_rows._exchanged(found, 0).independent == ((1, 2) if is_swapped else (0, 1))
    unit = np.random.default_rng(0).standard_normal((9, 6)) @ np.diag([1.0, 1.0, 1e-3, 1e-3, 1e-3, 1.0])
    rows = MetricRows(
        metric_rows.sparse(*np.indices(unit.shape).reshape(2, -1), unit.ravel(), unit.shape), Metric.unit(6)
    )
    found = independent_rows.dependence(rows, 6)
    assert max(abs(w) for of in found.weights for w in of.values()) <= 4.0
    for row, of in zip(found.rest, found.weights, strict=True):
        assert sum(w * rows.dense[i] for i, w in of.items()) == pytest.approx(rows.dense[row], abs=1e-8)


def test_rows_that_follow_from_rows_before_them_are_named_by_null_vectors():
    found = independent_rows.Dependence((0, 3, 4), (1, 2), ({0: 2.0}, {3: 1.0, 4: -1.0}))
    assert found.following() == [1, 4]


def chained(count):
    """Rows of a chain, each over its coordinate and the next one."""
    return [{k: 1.0, k + 1: -1.0} for k in range(count)]


def of_entries(rows, columns):
    """Many rows by their entries."""
    entries = [(i, j, value) for i, row in enumerate(rows) for j, value in row.items()]
    i, j, values = (np.array(each) for each in zip(*entries, strict=True))
    return MetricRows(metric_rows.sparse(i, j, values, (len(rows), columns)), Metric.unit(columns))


@pytest.mark.parametrize(("length", "is_among_them"), [(50, True), (70, False)])
def test_a_dependency_is_looked_for_among_sixty_near_rows(length, is_among_them, monkeypatch):
    """The difference of both ends of a chain follows from all of its rows."""
    monkeypatch.setattr(metric_rows, "are_many", lambda *_: True)
    asked = []
    plain = independent_rows._combinations
    monkeypatch.setattr(independent_rows, "_combinations", lambda *of: (asked.append(of[2]), plain(*of))[1])
    rows = of_entries([*chained(length), {0: 1.0, length: -1.0}], length + 1)
    found = independent_rows.over(rows, tuple(range(length)))
    assert sorted(found.weights[0]) == list(range(length))
    assert asked == ([] if is_among_them else [[length]])


def test_weights_over_all_rows_are_found_for_forty_at_once(monkeypatch):
    monkeypatch.setattr(metric_rows, "are_many", lambda *_: True)
    asked = []
    plain = independent_rows._combinations
    monkeypatch.setattr(
        independent_rows, "_combinations", lambda *of: (asked.append(len(of[2])), plain(*of))[1]
    )
    ends = [{k: 1.0, 100 + k: -1.0} for k in range(90)]
    rows = of_entries([*chained(200), *ends], 201)
    assert len(independent_rows.over(rows, tuple(range(200))).weights) == 90
    assert asked == [40, 40, 10]


@pytest.mark.parametrize(("more", "truth"), [(0.0, 6), (1e-9, None), (1e-4, 7)])
def test_rows_as_near_to_dependent_ones_as_long_structures_are_count_where_others_follow(
    more, truth, monkeypatch
):
    """Two rows 1e-6 apart, beside rows that repeat others, to all digits or to some."""
    rows = [{k: 1.0} for k in range(4)]
    rows += [{4: 1.0, 5: 1.0}, {4: 1.0, 5: 1.0 + 2e-6}, {0: 1.0, 1: 1.0}, {0: 1.0, 1: 2.0, 6: more}]
    monkeypatch.setattr(metric_rows, "are_many", lambda *_: True)
    assert precise_rows.rank_of_many(of_entries(rows, 7), [], np.zeros(0), 1.0) == truth


@pytest.mark.parametrize(("off", "truth"), [(0.0, 2), (1e-18, 2), (1e-13, None)])
def test_a_point_beside_its_surface_tells_no_rank_of_rows_that_are_near_to_dependent_ones(
    off, truth, monkeypatch
):
    monkeypatch.setattr(metric_rows, "are_many", lambda *_: True)
    rows = of_entries([{0: 1.0, 1: 1.0}, {0: 1.0, 1: 1.0 + 2e-6}], 2)
    assert precise_rows.rank_of_many(rows, [0, 1], np.array([0.0, off]), 1.0) == truth
