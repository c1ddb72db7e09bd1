"""What a count costs grows with the model: told by sizes and numbers of operations, never by seconds."""

import importlib

import casadi as ca
import numpy as np
import pytest

import lagcli
from lagcli.analysis.codimension import manifold
from lagcli.api import cache
from lagcli.compiled import factorization
from lagcli.compiled.selection import Selection
from lagcli.equations import row_parameters
from lagcli.errors import diagnostics
from lagcli.linear import metric, metric_rows, rank
from lagcli.linear.metric import Metric
from lagcli.linear.metric_rows import MetricRows
from lagcli.running import table_columns
from lagcli.start import initial

# The room gives a function of the same name.
examine = importlib.import_module("lagcli.analysis.codimension.examine")

WHEELS = """
lagcli: 1
coordinates:
  x[i]: {{for: "i = 1..{n}", value: i}}
  th[i]: {{for: "i = 1..{n}", value: 0.1*i}}
particles:
  c[i]: {{for: "i = 1..{n}", mass: 1, position: "[x[i], 0, 0]"}}
  e[i]: {{for: "i = 1..{n}", mass: 1, position: "[x[i] + cos(th[i]), sin(th[i]), 0]"}}
holonomic:
  h[i]: {{for: "i = 1..{n}", equation: "th[i] = 0.1*x[i]"}}
"""

BODY = """
lagcli: 1
particles:
  p[i]: {{for: "i = 1..{n}", mass: 1, position: "[i, 3*sin(1.7*i), 2*cos(2.3*i)]"}}
rigid:
  body: [p]
"""

COPIES = """
lagcli: 1
particles:
  a: {{mass: 1, position: [1, 0, 0]}}
holonomic:
  c[i]: {{for: "i = 1..{n}", equation: "i*(norm(a) - 1) = 0"}}
"""


def dof(text, **numbers):
    return lagcli.dof(lagcli.loads(text.format(**numbers))).configuration_dof


def test_coupled_coordinates_of_many_bodies_are_factored_body_by_body(monkeypatch):
    sizes = []
    for name in ("cholesky", "eigh"):
        plain = getattr(np.linalg, name)
        monkeypatch.setattr(np.linalg, name, lambda a, plain=plain: (sizes.append(len(a)), plain(a))[1])
    assert dof(WHEELS, n=30) == 30
    assert max(sizes) == 2


@pytest.mark.parametrize("seed", range(5))
def test_blocks_of_a_metric_give_what_the_whole_matrix_gives(seed):
    random = np.random.default_rng(seed)
    n = 7
    M = np.zeros((n, n))
    for block in ([0, 3, 5], [1, 4], [2], [6]):
        root = random.standard_normal((len(block), len(block) + 2))
        M[np.ix_(block, block)] = root @ root.T
    held = np.array([False, seed % 2 == 1, False, seed == 3, False, False, False])
    free = np.flatnonzero(~held)
    lower = np.linalg.cholesky(M[np.ix_(free, free)])
    B = random.standard_normal((4, n)) * (random.random((4, n)) < 0.5)
    found = Metric(ca.sparsify(ca.DM(M)), held)
    unit = np.array(found.whitened(ca.sparsify(ca.DM(B))))
    # The factor of M is one of many: products do not depend on it.
    assert unit @ unit.T == pytest.approx(B[:, free] @ np.linalg.solve(lower @ lower.T, B[:, free].T))
    u = random.standard_normal(free.size)
    step = found.unwhitened(u)
    assert not step[held].any()
    assert found.length(step) == pytest.approx(np.linalg.norm(u))


def test_a_coupled_block_that_is_singular_is_found_among_others():
    M = np.eye(6)
    M[np.ix_([1, 4], [1, 4])] = 1.0
    M[0, 2] = M[2, 0] = 0.5
    with pytest.raises(metric.NotDefiniteError) as raised:
        Metric(ca.sparsify(ca.DM(M)))
    assert raised.value.along in (1, 4)
    assert raised.value.value == pytest.approx(0.0, abs=1e-14)


def test_a_large_rigid_body_is_independent_without_a_solver_of_its_rows(monkeypatch):
    def refused(*_):
        raise AssertionError("a sparse solver of a dense matrix")

    monkeypatch.setattr(ca, "Linsol", refused)
    assert metric_rows.PARAMETERS.dense < 3 * 60 - 6
    assert dof(BODY, n=60) == 6


@pytest.mark.parametrize("seed", range(6))
def test_the_bound_from_rows_that_hang_on_their_own_coordinates_is_a_bound(seed):
    random = np.random.default_rng(seed)
    base, hanging = 3, 12
    B = np.zeros((base + hanging, 5 + hanging))
    B[:, :5] = random.standard_normal((base + hanging, 5)) * 10.0 ** random.integers(-2, 2)
    B[base:, 5:] = np.diag(random.uniform(0.2, 2.0, hanging))
    rows = MetricRows(ca.sparsify(ca.DM(B)), Metric.unit(B.shape[1]))
    least = np.linalg.svd(rows.dense, compute_uv=False)[-1]
    assert 0 < rows._least_with_hanging() <= least * (1 + 1e-12)


def test_proportional_rows_are_proved_to_follow_in_lots(monkeypatch):
    asked = []
    plain = manifold.is_regular
    monkeypatch.setattr(
        manifold, "is_regular", lambda part, *rest: (asked.append(len(part.rows)), plain(part, *rest))[1]
    )
    assert dof(COPIES, n=200) == 2
    # Each lot holds the one row that is kept and as many others as fit.
    assert len(asked) == -(-199 // (examine.TOGETHER - 1))
    assert max(asked) <= examine.TOGETHER


def test_rows_that_follow_are_proved_up_to_a_number_and_beyond_it_the_count_is_open(monkeypatch):
    assert examine.MOST_DEPENDENCIES == 3000
    monkeypatch.setattr(examine, "MOST_DEPENDENCIES", 20)
    assert dof(COPIES, n=21) == 2
    many = metric_rows.PARAMETERS.dense + 1  # fewer rows are looked at together
    found = lagcli.dof(lagcli.loads(COPIES.format(n=many)))
    assert found.configuration_dof is None
    assert f"{many - 1} rows depend on others at the start, such as `c[2]`" in found.reason


def test_very_many_rows_over_few_coordinates_have_their_rank_by_a_thin_factorization():
    count = metric_rows.PARAMETERS.most_dense + 1
    B = np.outer(np.arange(1.0, count + 1), [1.0, 2.0, 0.0])
    B[7] = [0.0, 0.0, 1.0]
    found = rank.estimate(MetricRows(ca.sparsify(ca.DM(B)), Metric.unit(3)))
    assert found.value == 2
    # All rows that depend on others take part in the one vector that is given; the row that does not, does not.
    assert found.dependences.shape == (1, count)
    assert rank.participants(found.dependences[0]) == [i for i in range(count) if i != 7]


def test_groups_of_circuits_are_joined_where_they_share_a_row():
    dependencies = ((1, 0), (3, 2), (5, 0, 4), (6,), (7, 2))
    assert list(Selection((0, 2, 4), dependencies).groups()) == [([1, 5], [0, 4]), ([3, 7], [2])]


WATT = """
lagcli: 1
particles:
  a: {mass: 1, position: [0, 1, 0]}
  b: {mass: 1, position: [0, -1, 0]}
  c: {mass: 1, position: [4, 1, 0]}
  d: {mass: 1, position: [4, -1, 0]}
holonomic:
  r1: distance(a, [-3, 1, 0]) = 3
  r2: distance(b, [3, -1, 0]) = 3
  r3: distance(a, b) = 2
  s1: distance(c, [7, 1, 0]) = 3
  s2: distance(d, [1, -1, 0]) = 3
  s3: distance(c, d) = 2
  bar: norm((a + b)/2 - (c + d)/2) = 4
  za: a.z = 0
  zb: b.z = 0
  zc: c.z = 0
  zd: d.z = 0
"""

PLANE = "lagcli: 1\ncoordinates: {x: {}, y: {}, z: {}}\nlagrangian: rate(x)**2 + rate(y)**2 + rate(z)**2\n"


def refusal(text):
    with pytest.raises(diagnostics.ModelError) as raised:
        lagcli.simulate(lagcli.loads(text), duration=1, samples=2)
    (found,) = raised.value.diagnostics
    return found


def test_no_row_of_the_double_watt_linkage_is_to_be_left_out():
    found = refusal(WATT)
    assert found.code == "dependent-constraints"
    assert "none of them can be left out" in found.hint
    assert "follow" not in found.hint


def test_one_row_whose_gradient_vanishes_depends_on_no_other():
    text = PLANE + "holonomic: {c: y**3 = x**4}\n"
    reason = lagcli.dof(lagcli.loads(text)).reason
    assert reason.startswith("the gradient of `c` vanishes at the start")
    assert "depend on one another" not in reason


def test_rows_that_depend_on_others_beside_the_start_too_are_named():
    # The third row is the sum of the others; a touch of the fourth order leaves the count open.
    text = PLANE + "holonomic: {p: x = 0, r: x + 100*y**4 = 0, s: 2*x + 100*y**4 = 0}\n"
    found = refusal(text)
    assert "`s` depends on the others beside the start too" in found.hint


def test_a_product_of_many_rows_is_not_written_out(monkeypatch):
    ready = cache.compiled(lagcli.loads(BODY.format(n=40)))
    made, function = [], factorization.SizedFunction
    monkeypatch.setattr(factorization, "SizedFunction", lambda *of: made.append(function(*of)) or made[-1])
    found = factorization.Factored(ready.numeric._parts)
    assert found.projection.n_out() == 5
    assert found.position.n_out() == 1
    count = len(ready.system.rows.rows)
    assert max(each.n_instructions() for each in made if each.is_a("SXFunction")) < count**2


def test_the_names_of_many_columns_are_collected_once(monkeypatch):
    """Of 400 particles, as often as there are kinds of columns, and not for each particle anew."""
    chain = (
        'lagcli: 1\nparticles: {"p[i]": {for: "i = 1..400", mass: 1, position: [i, 0, 0]}}\n'
        'holonomic: {"link[i]": {for: "i = 2..400", equation: "distance(p[i], p[i-1]) = 1"}}\n'
    )
    ready = cache.compiled(lagcli.loads(chain))
    collected = []
    own = lambda values=(): (collected.append(len(values)), frozenset(values))[1]  # noqa: E731
    monkeypatch.setattr(table_columns, "set", own, raising=False)
    p = initial.declared(ready.system).p
    table_columns.Floors(ready.system, ready.numeric, p, ("t", *ready.system.columns))
    assert 0 < sum(collected) <= 10 * 1200


def test_parameters_are_looked_for_in_the_entries_of_matrices_and_not_in_their_zeros(monkeypatch):
    links = "  link[i]: {for: 'i = 2..30', equation: 'distance(p[i], p[i-1]) = 1'}\n"
    particles = "particles:\n  p[i]: {for: 'i = 1..30', mass: 1, position: [i, 0, 0]}\n"
    model = lagcli.loads(f"lagcli: 1\n{particles}holonomic:\n  hook: norm(p[1]) = 1\n{links}")
    seen, symvar = [], ca.symvar
    monkeypatch.setattr(row_parameters.ca, "symvar", lambda x: seen.append(x.numel()) or symvar(x))
    system = cache.compiled(model).system
    row_parameters.of_start(system)
    assert seen
    assert max(seen) < system.symbols.q.numel() ** 2
