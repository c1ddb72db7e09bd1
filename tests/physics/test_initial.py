"""The start of a run: refused with residuals by name, or assembled to the nearest consistent state."""

import numpy as np
import pytest
from scipy import optimize

import lagcli
from lagcli.api import prepare_run, run_settings

TWO = """
lagcli: 1
parameters: {ma: 1, mb: 4}
particles:
  a: {mass: ma, position: [0.9, 0.2, -0.3], velocity: [0.3, 1, 0]}
  b: {mass: mb, position: [2.1, 0.4, 0.5], velocity: [0, -1, 2]}
holonomic:
  sphere: dot(a, a) = 1
  rod: distance(a, b) = 1.5
differential:
  skate: b.x*rate(b.y) - rate(a.z) = 0.2
"""


def single(law, position, velocity=(0, 0, 0), mass=1):
    """One particle with one holonomic constraint, which stands in line 5."""
    start = f"position: {list(position)}, velocity: {list(velocity)}"
    return f"lagcli: 1\nparticles:\n  a: {{mass: {mass}, {start}}}\nholonomic:\n  f: {law}\n"


def refused(text, action=lagcli.simulate, **options):
    with pytest.raises(lagcli.ModelError) as caught:
        action(lagcli.loads(text), **options)
    return caught.value.diagnostics


def assembled(text, parameters=None, **options):
    """The assembled start as a table of one row."""
    model = lagcli.loads(text, parameters=parameters)
    return lagcli.simulate(model, duration=0, assemble=True, **options)


def state(table, names):
    """Positions and velocities of particles, shape (3 N,) each."""
    positions = [table[f"{n}.{c}"][0] for n in names for c in "xyz"]
    velocities = [table[f"{n}.v{c}"][0] for n in names for c in "xyz"]
    return np.array(positions), np.array(velocities)


# Refusal.


def test_every_violated_row_is_named_with_its_residual():
    found = {d.message for d in refused(TWO)}
    assert {d.code for d in refused(TWO)} == {"inconsistent-start"}
    # |f| as it is written, and |f| / |grad f|, a length in the unit of the model.
    a, b = np.array([0.9, 0.2, -0.3]), np.array([2.1, 0.4, 0.5])
    sphere = abs(a @ a - 1), 2 * np.linalg.norm(a), "m"
    rod = abs(np.linalg.norm(b - a) - 1.5), np.sqrt(2), "m"
    skate = abs(2.1 * -1 - 0 - 0.2), np.hypot(2.1, 1), "m/s"
    for row, (residual, norm, unit) in (("sphere", sphere), ("rod", rod), ("skate", skate)):
        told = f"`{row}` by {residual:.6g} ({residual / norm:.6g} {unit} per unit of its gradient)"
        assert any(told in message for message in found), (row, found)


def test_error_stands_at_the_row_and_says_how_to_go_on():
    (diagnostic,) = refused(single("a.x = 2", [1, 2, 3]))
    assert (diagnostic.location.line, diagnostic.severity) == (5, "error")
    assert "--assemble" in diagnostic.hint


def test_velocities_alone_may_be_inconsistent():
    text = single("norm(a) = 2", [2, 0, 0], [3, 1, 0])
    (diagnostic,) = refused(text)
    assert "velocities violate `f` by 3 m/s" in diagnostic.message


def test_moving_constraint_asks_for_its_own_speed():
    assert "by 3" in refused(single("a.x = 3*t", [0, 0, 0]))[0].message
    run = lagcli.simulate(lagcli.loads(single("a.x = 3*t", [0, 0, 0], [3, 0, 0])), duration=1)
    assert run["a.x"][-1] == pytest.approx(3)


def test_start_time_enters_the_constraints():
    text = single("a.x = 3*t", [6, 0, 0], [3, 0, 0])
    assert refused(text)
    assert lagcli.simulate(lagcli.loads(text), start=2.0, duration=1)["a.x"][-1] == pytest.approx(9)


@pytest.mark.parametrize(("error", "accepted"), [(1e-12, True), (1e-7, False)])
@pytest.mark.parametrize("size", [1.0, 1e9, 1e-9])
def test_rounding_of_the_declared_values_is_no_inconsistency(size, error, accepted):
    place = size * (1 + error)
    text = single(f"norm(a) = {size!r}", [place, 0, 0])
    if accepted:
        run = lagcli.simulate(lagcli.loads(text), duration=0)
        assert run["a.x"][0] == pytest.approx(size, rel=1e-15)
    else:
        assert refused(text)[0].code == "inconsistent-start"


def test_check_warns_where_a_run_refuses_and_reports_all_the_same():
    report = lagcli.check(lagcli.loads(TWO))
    assert not report.initial.consistent
    a, b = np.array([0.9, 0.2, -0.3]), np.array([2.1, 0.4, 0.5])
    f = abs(a @ a - 1), abs(np.linalg.norm(b - a) - 1.5)
    assert report.initial.position_residual == pytest.approx(max(f))
    assert [w.severity for w in report.warnings if w.code == "inconsistent-start"] == ["warning"] * 3
    assert report.dof.holonomic == 2


# Assembly.


@pytest.mark.parametrize("place", [(3, 4, 0), (0.1, 0.2, -0.3), (-7, 0, 1e-3)])
def test_nearest_point_of_a_sphere_lies_on_the_ray(place):
    text = single("norm(a) = 2", place, [1, 2, 3], mass=2)
    r, v = state(assembled(text), ["a"])
    ray = np.array(place) / np.linalg.norm(place)
    assert np.allclose(r, 2 * ray, rtol=0, atol=1e-12)
    assert np.allclose(v, np.array([1, 2, 3]) - ray * (ray @ [1, 2, 3]), rtol=0, atol=1e-12)


def test_masses_weigh_how_far_each_particle_moves():
    text = """
lagcli: 1
particles:
  a: {mass: 1, position: [0, 0, 0]}
  b: {mass: 3, position: [2, 0, 0]}
holonomic:
  f: distance(a, b) = 1
"""
    r, _ = state(assembled(text), ["a", "b"])
    assert np.allclose(r, [0.75, 0, 0, 1.75, 0, 0], rtol=0, atol=1e-12)


@pytest.mark.parametrize(("ma", "mb"), [(1, 4), (4, 1), (1, 1e4)])
def test_assembly_is_the_nearest_point_in_the_mass_weighted_norm(ma, mb):
    r0 = np.array([0.9, 0.2, -0.3, 2.1, 0.4, 0.5])
    weight = np.repeat([ma, mb], 3) / max(ma, mb)
    laws = {"type": "eq", "fun": lambda r: [r[:3] @ r[:3] - 1, np.linalg.norm(r[3:] - r[:3]) - 1.5]}
    best = optimize.minimize(
        lambda r: weight @ (r - r0) ** 2,
        r0,
        jac=lambda r: 2 * weight * (r - r0),
        constraints=laws,
        method="SLSQP",
        options={"ftol": 1e-15, "maxiter": 500},
    )
    r, _ = state(assembled(TWO, {"ma": ma, "mb": mb}), ["a", "b"])
    assert abs(r[:3] @ r[:3] - 1) <= 1e-13
    assert abs(np.linalg.norm(r[3:] - r[:3]) - 1.5) <= 1e-13
    assert weight @ (r - r0) ** 2 == pytest.approx(best.fun, rel=1e-7)
    assert np.allclose(r, best.x, rtol=0, atol=1e-5)
    # r - r0 = M^-1 B^T mu, exactly: what is left of it beside the gradients vanishes.
    B = np.array([[*r[:3], 0, 0, 0], [*(r[:3] - r[3:]), *(r[3:] - r[:3])]])
    moved = weight * (r - r0)
    left = moved - B.T @ np.linalg.lstsq(B.T, moved, rcond=None)[0]
    assert np.abs(left).max() <= 1e-9 * np.abs(moved).max()


def test_assembled_velocities_are_the_nearest_too():
    r, v = state(assembled(TWO), ["a", "b"])
    v0 = np.array([0.3, 1, 0, 0, -1, 2])
    B = np.array([[*r[:3], 0, 0, 0], [*(r[:3] - r[3:]), *(r[3:] - r[:3])], [0, 0, -1, 0, r[3], 0]])
    M = np.repeat([1.0, 4.0], 3)
    mu = np.linalg.solve(B / M @ B.T, B @ v0 - [0, 0, 0.2])
    assert np.allclose(v, v0 - B.T @ mu / M, rtol=0, atol=1e-12)


def test_consistent_start_is_not_moved():
    text = single("norm(a) = 1", [0.6, 0, -0.8], [0.8, 1, 0.6])
    r, v = state(assembled(text), ["a"])
    assert np.allclose([*r, *v], [0.6, 0, -0.8, 0.8, 1, 0.6], rtol=0, atol=1e-15)


@pytest.mark.parametrize("keep", [("a",), ("a.x", "a.y", "a.z"), ("b",), ("b.x", "a.z")])
def test_kept_coordinates_hold_their_values_and_rates(keep):
    text = "\n".join(line for line in TWO.splitlines() if "sphere" not in line)
    table = assembled(text, keep=keep)
    r, v = state(table, ["a", "b"])
    places = [f"{n}.{c}" for n in "ab" for c in "xyz"]
    kept = [i for i, name in enumerate(places) if name in keep or name[0] in keep]
    assert np.allclose(r[kept], np.array([0.9, 0.2, -0.3, 2.1, 0.4, 0.5])[kept], rtol=0, atol=1e-15)
    assert np.allclose(v[kept], np.array([0.3, 1, 0, 0, -1, 2])[kept], rtol=0, atol=1e-15)
    assert abs(np.linalg.norm(r[3:] - r[:3]) - 1.5) <= 1e-13
    assert abs(r[3] * v[4] - v[2] - 0.2) <= 1e-13


def test_assembly_reports_how_far_it_moved():
    text = single("norm(a) = 2", [3, 0, 0], [0.5, 1, 0], mass=4)
    model = lagcli.loads(text)
    running = prepare_run.start(model, run_settings.chosen(model, {"assemble": True}))
    assert running.assembly.moved == pytest.approx(2.0)
    assert running.assembly.moved_velocity == pytest.approx(1.0)


def test_keep_that_holds_too_much_is_refused():
    text = TWO.replace("position: [0.9, 0.2, -0.3]", "position: [2, 0, 0]")
    (diagnostic,) = refused(text, assemble=True, keep=("a",))
    assert diagnostic.code == "no-consistent-start"
    assert "`sphere`" in diagnostic.message
    assert "keep" in diagnostic.hint


@pytest.mark.parametrize(
    "law", ["dot(a, a) = -1", "exp(a.x) = 0", "a.x**2 + (a.y - 1)**2 + 1e-3 = 0", "sin(a.x) = 2"]
)
def test_constraint_that_nothing_satisfies_is_refused(law):
    text = single(law, [1, 2, 3])
    (diagnostic,) = refused(text, assemble=True)
    assert diagnostic.code == "no-consistent-start"
    assert refused(text, lagcli.dof)


def test_contradictory_velocities_are_refused():
    text = """
lagcli: 1
particles:
  a: {mass: 1, position: [1, 2, 3]}
differential:
  f: rate(a.x) = 1
  g: rate(a.x) = 2
"""
    (diagnostic,) = refused(text, assemble=True)
    assert diagnostic.code == "contradictory-constraints"
    assert "`f`, `g`" in diagnostic.message


def test_assembly_from_far():
    text = (
        "lagcli: 1\ncoordinates: {u: {value: 2.0}, w: {value: -1.5}}\nlagrangian: rate(u)**2 + rate(w)**2\n"
        "holonomic:\n  x: cos(u) + cos(w) = 1.2\n  y: sin(u) + sin(w) = 0.7\n"
    )
    table = assembled(text)
    u, w = table["u"][0], table["w"][0]
    assert abs(np.cos(u) + np.cos(w) - 1.2) <= 1e-13
    assert abs(np.sin(u) + np.sin(w) - 0.7) <= 1e-13


# Inertia, poles.


def test_coordinate_without_inertia_is_refused_by_name():
    text = "lagcli: 1\ncoordinates: {x: {}, y: {}, z: {}}\nlagrangian: rate(x)**2 - y**2 + x*z\n"
    found = refused(text)
    assert [(d.code, d.location.line) for d in found] == [("no-inertia", 2)] * 2
    assert ["`y`" in d.message or "`z`" in d.message for d in found] == [True, True]
    assert lagcli.dof(lagcli.loads(text)).configuration_dof == 3


@pytest.mark.parametrize(
    "lagrangian", ["rate(x)**2 - rate(y)**2", "(rate(x) + rate(y))**2", "rate(x)*rate(y)"]
)
def test_inertia_that_is_not_definite_is_refused(lagrangian):
    (diagnostic,) = refused(f"lagcli: 1\ncoordinates: {{x: {{}}, y: {{}}}}\nlagrangian: {lagrangian}\n")
    assert diagnostic.code == "indefinite-inertia"


def test_inertia_that_vanishes_at_the_start_is_refused():
    # Spherical angles at the pole.
    text = """
lagcli: 1
coordinates: {th: {value: 0}, ph: {}}
particles:
  a: {mass: 1, position: "[sin(th)*cos(ph), sin(th)*sin(ph), cos(th)]"}
"""
    (diagnostic,) = refused(text)
    assert diagnostic.code in ("no-inertia", "indefinite-inertia")
    assert "`ph`" in diagnostic.message


@pytest.mark.parametrize(
    ("law", "row"), [("log(a.x) = 1", "g"), ("1/a.x = 1", "g"), ("distance(a, [0, 0, 0]) = 0", "g")]
)
def test_row_with_a_pole_at_the_start_is_refused_by_name(law, row):
    text = single("a.y = 0", [0, 0, 0]) + f"  {row}: {law}\n"
    for action in (lagcli.simulate, lagcli.check, lagcli.dof):
        diagnostics = refused(text, action)
        assert any(d.code == "not-finite-at-start" and f"`{row}`" in d.message for d in diagnostics), action


def test_assembly_from_far_finds_the_nearest_point_of_an_ellipse():
    text = """
lagcli: 1
particles: {a: {mass: 1, position: [5, 3, 0]}}
holonomic: {oval: a.x**2/4 + a.y**2 = 1, plane: a.z = 0}
"""
    r, _ = state(assembled(text), ["a"])
    angle = np.linspace(0.0, 2 * np.pi, 1_000_001)
    nearest = np.hypot(5 - 2 * np.cos(angle), 3 - np.sin(angle)).min()
    assert np.hypot(5 - r[0], 3 - r[1]) == pytest.approx(nearest, abs=1e-10)


def test_assembly_does_not_stay_on_a_saddle():
    text = """
lagcli: 1
particles: {a: {mass: 1, position: [0.1, 0, 0]}}
holonomic: {oval: a.x**2/4 + a.y**2 = 1, plane: a.z = 0}
"""
    r, _ = state(assembled(text), ["a"])
    assert np.hypot(0.1 - r[0], r[1]) < 1.0


def test_kept_coordinates_that_leave_nothing_to_move_are_refused():
    text = """
lagcli: 1
particles: {a: {mass: 1, position: [1, 0.2, 0], velocity: [0.1, 1, 0]}}
holonomic: {c: norm(a) = 1}
simulation: {assemble: true, keep: [a.x, a.z]}
"""
    assert refused(text)[0].code == "no-consistent-start"


def test_energy_balance_of_a_lagrangian_is_a_part_of_its_own_energy():
    text = "lagcli: 1\ncoordinates: {q: {value: 1e-3}}\nlagrangian: 1e-12*(rate(q)**2/2 - q**2/2)\n"
    model = lagcli.loads(text)
    loose = lagcli.simulate(model, duration=50, samples=11, rtol=0.1, atol=1)
    fine = lagcli.simulate(model, duration=50, samples=11)
    assert loose.stats.energy_imbalance > 1e-3
    assert fine.stats.energy_imbalance < 1e-8
