"""Free particles are counted however many they are; what would take too much memory is refused with its place."""

import pytest

import lagcli
from lagcli.analysis import dof
from lagcli.equations import size_limits, system
from lagcli.errors import diagnostics

FREE = """
lagcli: 1
particles:
  p[i]: {{for: "i = 1..{n}", mass: "1 + i", position: "[i, 0, 0]", velocity: "[0, i, 0]"}}
  a: {{mass: 2, position: [0, 0, 1]}}
forces:
  weight: {{to: all, force: [0, 0, -9.81*m]}}
"""

CHAIN = """
lagcli: 1
particles:
  p[i]: {{for: "i = 1..{n}", mass: 1, position: "[i, 0, 0]"}}
holonomic:
  link[i]: {{for: "i = 2..{n}", equation: "distance(p[i-1], p[i]) = 1"}}
"""


def test_free_particles_are_counted_as_by_their_equations(monkeypatch):
    model = lagcli.loads(FREE.format(n=4))
    found, report = lagcli.dof(model), lagcli.check(model)
    monkeypatch.setattr(dof, "are_free_particles", lambda model: False)
    assert found == lagcli.dof(model)
    assert report == lagcli.check(model)
    assert found.configuration_dof == 15


def test_very_many_free_particles_are_counted_without_their_equations(monkeypatch):
    def refused(*_):
        raise AssertionError("equations are built")

    monkeypatch.setattr(system, "build", refused)
    model = lagcli.loads(FREE.format(n=200_000))
    assert size_limits.MOST_BUILT < 3 * 200_001
    assert lagcli.dof(model).configuration_dof == 600_003
    assert lagcli.check(model).dof.configuration_dof == 600_003


@pytest.mark.parametrize(
    "more",
    [
        "holonomic: {rod: norm(a) = 1}\n",
        "differential: {row: d(a.z) = 0}\n",
        "rigid: {body: [a, 'p[1]']}\n",
        "coordinates: {theta: {}}\nlagrangian: rate(theta)**2\n",
        "outputs: {height: a.z}\n",
    ],
)
def test_what_is_held_or_asked_for_is_built(more):
    assert not dof.are_free_particles(lagcli.loads(FREE.format(n=2) + more))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("force: [0, 0, -9.81*m]", "force: -v"),
        ("to: all, force: [0, 0, -9.81*m]", "potential: a.z**2"),
        ("position: [0, 0, 1]", "position: [0, 0, t]"),
    ],
)
def test_laws_that_are_no_constants_are_built(old, new):
    text = FREE.format(n=2)
    assert old in text
    assert not dof.are_free_particles(lagcli.loads(text.replace(old, new)))


def test_a_chain_of_a_hundred_thousand_links_is_built():
    assert 3 * 100_000 + 99_999 <= size_limits.MOST_BUILT <= 4 * 120_000


@pytest.mark.parametrize("work", [lagcli.dof, lagcli.check, lagcli.simulate, lagcli.derive])
def test_a_model_that_is_too_large_is_refused_before_it_is_built(work, monkeypatch):
    monkeypatch.setattr(size_limits, "MOST_BUILT", 38)
    work_on = lagcli.loads(CHAIN.format(n=11))
    with pytest.raises(diagnostics.ModelError) as raised:
        work(work_on)
    (found,) = raised.value.diagnostics
    assert found.code == "too-large-to-build"
    assert found.location.line == 4  # the largest entry
    assert "43 together, and equations are built for at most 38" in found.message
    lagcli.dof(lagcli.loads(CHAIN.format(n=9)))  # 35


def test_a_run_that_takes_too_much_memory_is_refused_with_its_location(monkeypatch):
    n, rows = 3 * 30, 29
    # Of a chain each coordinate between the ends stands in two rows.
    entries = 3 * (2 + 28 * 4)
    needed = (
        size_limits.ALWAYS
        + size_limits.OF_COORDINATE * n
        + size_limits.OF_ROW * rows
        + size_limits.OF_ENTRY * min(entries, rows**2)
    )
    model = lagcli.loads(CHAIN.format(n=30))
    monkeypatch.setattr(size_limits, "MOST_BYTES", needed - 1)
    with pytest.raises(diagnostics.ModelError) as raised:
        lagcli.simulate(model, duration=0.01, samples=2)
    (found,) = raised.value.diagnostics
    assert found.code == "too-large-to-build"
    assert found.location.line == 4
    monkeypatch.setattr(size_limits, "MOST_BYTES", needed)
    assert lagcli.simulate(model, duration=0.01, samples=2).stats.steps > 0


def test_what_a_run_takes_is_reckoned_as_measured():
    assert (size_limits.ALWAYS, size_limits.OF_COORDINATE, size_limits.OF_ROW) == (6e7, 4.8e3, 2.5e4)
    assert (size_limits.OF_ENTRY, size_limits.MOST_BYTES) == (4e2, 2e9)
