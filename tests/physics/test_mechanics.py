"""Equations of motion: sign and size of the multipliers, reactions, forces, energies, parameters."""

import functools
import pathlib

import numpy as np
import pytest

import lagcli
from lagcli.analysis import examined_start
from lagcli.api import cache
from lagcli.simulation.scheme import method

MODELS = pathlib.Path(__file__).parents[2] / "models"
G = 9.81


def run(text, **options):
    options = {"duration": 1.0, "samples": 11} | options
    return lagcli.simulate(lagcli.loads(text), **options)


def close(found, expected, tolerance=1e-10):
    """Whether found equals expected within a part of the largest expected value (of 1 where all vanish)."""
    found, expected = np.asarray(found), np.asarray(expected)
    scale = np.abs(expected).max() or 1.0
    return bool(np.abs(found - expected).max() <= tolerance * scale)


def codes(warnings):
    return [warning.code for warning in warnings]


# The stick of (D.12): whatever the slope, the weights and the motion of the ramp, T12 = T m2/(m1 + m2).


@pytest.mark.parametrize("ramp", ["ramp-stick", "moving-ramp-stick"])
@pytest.mark.parametrize(
    ("m1", "m2"), [(3, 2), (2, 3), (1e6, 1), (1, 1e6), (1e3, 1e-3)], ids=lambda mass: f"{mass:g}"
)
def test_stick_carries_its_share_of_the_pull(ramp, m1, m2):
    model = lagcli.load(MODELS / f"{ramp}.yaml", parameters={"m1": m1, "m2": m2})
    table = lagcli.simulate(model, samples=11)
    T = 70.0
    share = m2 / (m1 + m2)
    assert np.abs(table["lambda.stick"] - T * share).max() <= 1e-10 * T


@pytest.mark.parametrize("ramp", ["ramp-stick", "moving-ramp-stick"])
def test_stick_under_a_light_or_a_heavy_lower_block(ramp):
    def pull(m1, m2):
        model = lagcli.load(MODELS / f"{ramp}.yaml", parameters={"m1": m1, "m2": m2})
        return lagcli.simulate(model, samples=3)["lambda.stick"]

    assert np.abs(pull(1e9, 1)).max() <= 70 * 1e-8
    assert np.abs(pull(1, 1e9) - 70).max() <= 70 * 1e-8


# Signs.

PLUMB = """
lagcli: 1
parameters: {{m: 1.7, g: 9.81, L: 2.5}}
particles:
  hook: {{mass: 1, position: [0, 0, 0]}}
  a: {{mass: m, position: [0, 0, -L]}}
forces:
  weight: {{to: a, force: [0, 0, -m*g]}}
holonomic:
  fixed: hook = [0, 0, 0]
  line: "{line}"
"""


@pytest.mark.parametrize(
    ("line", "multiplier"),
    [
        ("distance(a, hook) = L", -1.7 * G),
        ("L = distance(a, hook)", 1.7 * G),
        ("a.x**2 + a.y**2 + a.z**2 - L**2", -1.7 * G / 5),
        ("L**2 = a.x**2 + a.y**2 + a.z**2", 1.7 * G / 5),
        ("1e6*(dot(a, a) - L**2) = 0", -1.7 * G / 5e6),
        ("-1e-6*(dot(a, a) - L**2) = 0", 1.7 * G / 5e-6),
        ("log(norm(a)/L) = 0", -1.7 * G * 2.5),
    ],
)
def test_plumb_line_holds_its_bob_up(line, multiplier):
    table = run(PLUMB.format(line=line))
    assert close(table.reaction("a"), np.tile([0, 0, 1.7 * G], (11, 1)))
    assert close(table["lambda.line"], np.full(11, multiplier))
    assert close(table["a.z"], np.full(11, -2.5))


@pytest.mark.parametrize(
    ("section", "law", "multiplier"),
    [
        ("holonomic", "a.z = 1", 1),
        ("holonomic", "1 = a.z", -1),
        ("holonomic", "a.z - 1", 1),
        ("holonomic", "5*a.z = 5", 0.2),
        ("differential", "d(a.z) = 0", 1),
        ("differential", "0 = d(a.z)", -1),
        ("differential", "rate(a.z) = 0", 1),
        ("differential", "-4*a.vz = 0", -0.25),
    ],
)
def test_multiplier_follows_left_minus_right(section, law, multiplier):
    table = run(
        f"""
lagcli: 1
particles:
  a: {{mass: 3, position: [0, 0, 1], velocity: [1, 0, 0]}}
forces:
  weight: {{to: a, force: [0, 0, -m*9.81]}}
{section}:
  floor: {law}
"""
    )
    assert close(table["lambda.floor"], np.full(11, multiplier * 3 * G))
    assert close(table["R.a.z"], np.full(11, 3 * G))
    assert close(table["a.x"], table.t)


# Forces.


def test_generalized_force_drives_its_coordinate():
    table = run(
        """
lagcli: 1
parameters: {J: 0.4, tau: 3}
coordinates: {theta: {value: 0.5, rate: -1}, phi: {rate: 2}}
lagrangian: J*(rate(theta)**2 + rate(phi)**2)/2
forces:
  motor: {to: theta, force: tau*(1 + t)}
  brake: {to: [theta, phi], force: -tau/10}
"""
    )
    t = table.t
    assert close(table["theta"], 0.5 - t + 7.5 * ((1 - 0.1) * t**2 / 2 + t**3 / 6))
    assert close(table["phi"], 2 * t - 0.75 * t**2 / 2)


def test_force_on_a_dependent_particle_becomes_a_generalized_force():
    table = run(
        """
lagcli: 1
coordinates: {s: {value: 2, rate: 1}}
particles:
  a: {mass: 2, position: "[3*s, 0, 4*s]"}
forces:
  push: {to: a, force: "[10*sin(t), 7, -5*s/s]"}
"""
    )
    # Q = F . dr/ds = 30 sin t - 20, inertia 2*25; the part of F across the line is what R balances.
    t = table.t
    assert close(table["s"], 2 + t + 0.6 * (t - np.sin(t)) - 0.2 * t**2)
    F = np.stack([10 * np.sin(t), np.full_like(t, 7), np.full_like(t, -5)], axis=1)
    along = np.array([0.6, 0, 0.8])
    assert close(table.reaction("a"), np.outer(F @ along, along) - F)


def test_own_letters_of_a_force_on_many_particles():
    table = run(
        """
lagcli: 1
particles:
  a: {mass: 2, position: [1, 0, 0], velocity: [0, 3, 0]}
  b: {mass: 8, position: [0, 0, 2], velocity: [1, 0, 0]}
forces:
  swing: {to: [a, b], force: -4*r}
  drift: {to: all, force: "m*[0, 0, 0]"}
"""
    )
    t = table.t
    assert close(table["a.x"], np.cos(np.sqrt(2) * t))
    assert close(table["a.y"], 3 / np.sqrt(2) * np.sin(np.sqrt(2) * t))
    assert close(table["b.x"], np.sqrt(2) * np.sin(t / np.sqrt(2)))
    assert close(table["b.z"], 2 * np.cos(t / np.sqrt(2)))


def test_drag_takes_energy_and_the_account_knows_it():
    table = run(
        """
lagcli: 1
particles:
  a: {mass: 2, position: [0, 0, 0], velocity: [3, 0, 0]}
forces:
  drag: {to: a, force: -0.5*v}
"""
    )
    assert close(table["a.vx"], 3 * np.exp(-table.t / 4))
    assert close(table["energy"], 9 * np.exp(-table.t / 2))
    assert table.stats.energy_imbalance <= 1e-10


# Rows.


def test_vector_equation_stands_for_three_named_rows():
    table = run(
        """
lagcli: 1
particles:
  a: {mass: 2, position: [1, 2, 3]}
forces:
  pull: {to: a, force: [5, -7, 11]}
holonomic:
  pin: "a = [1, 2, 3]"
outputs:
  same: multiplier(pin)
  one: multiplier(pin.y)
"""
    )
    expected = np.tile([-5.0, 7.0, -11.0], (11, 1))
    assert [c for c in table.columns if c.startswith("lambda.")] == [f"lambda.pin.{axis}" for axis in "xyz"]
    assert close(table.multiplier("pin"), expected)
    assert close(table.reaction("a"), expected)
    assert close(np.stack([table[f"same.{axis}"] for axis in "xyz"], axis=1), expected)
    assert close(table["one"], np.full(11, 7.0))


def test_vector_law_of_velocities():
    text = """
lagcli: 1
particles:
  a: {{mass: 2, position: [0, 0, 0], velocity: [1, 0, 0]}}
  b: {{mass: 3, position: [0, 1, 0], velocity: [1, 0, 0]}}
forces:
  pull: {{to: a, force: [10, 20, 30]}}
differential:
  together: {law}
"""
    for law in ("a.v - b.v = [0, 0, 0]", "d(a) - d(b) = [0, 0, 0]"):
        table = run(text.format(law=f'"{law}"'))
        # Both accelerate with F/(m1 + m2); b is driven by -lambda.
        assert close(table.multiplier("together"), np.tile([-6.0, -12.0, -18.0], (11, 1)))
        assert close(table.reaction("b"), np.tile([6.0, 12.0, 18.0], (11, 1)))


KNIFE = """
lagcli: 1
coordinates: {{x: {{}}, y: {{}}, th: {{value: 0.3, rate: 1.2}}}}
lagrangian: 1.25*(rate(x)**2 + rate(y)**2)/2 + 0.13*rate(th)**2/2 + 6*x - y
differential:
  edge: "{law}"
"""


@pytest.mark.parametrize(
    "law",
    [
        "sin(th)*rate(x) - cos(th)*rate(y) = 0",
        "sin(th)*d(x) = cos(th)*d(y)",
        "d(x*sin(th)) - x*cos(th)*d(th) - cos(th)*d(y)",
    ],
)
def test_both_forms_of_a_differential_law_are_one_law(law):
    plain = run(KNIFE.format(law="sin(th)*d(x) - cos(th)*d(y) = 0"), duration=3)
    other = run(KNIFE.format(law=law), duration=3)
    assert plain.columns == other.columns
    assert np.abs(plain.rows - other.rows).max() <= 1e-13 * np.abs(plain.rows).max()


@pytest.mark.parametrize(
    ("section", "law"),
    [
        ("holonomic", "lift.z = 3*t + A*t**2/2"),
        ("differential", "d(lift.z) - (3 + A*t)*dt = 0"),
        ("differential", "rate(lift.z) = 3 + A*t"),
    ],
)
def test_moving_constraint_adds_its_acceleration(section, law):
    table = run(
        f"""
lagcli: 1
parameters: {{A: 4}}
particles:
  lift: {{mass: 2, position: [0, 0, 0], velocity: [0, 0, 3]}}
forces:
  weight: {{to: all, force: [0, 0, -m*9.81]}}
{section}:
  cable: {law}
"""
    )
    assert close(table["lift.z"], 3 * table.t + 2 * table.t**2)
    assert close(table["R.lift.z"], np.full(11, 2 * (G + 4)))
    assert table.stats.energy_imbalance <= 1e-10


def test_coefficients_that_depend_on_time_and_position():
    # A wire that turns at the rate w about the origin carries its bead outwards: r = r0 cosh(w t).
    table = run(
        """
lagcli: 1
parameters: {w: 2, r0: 0.5}
particles:
  bead: {mass: 3, position: [r0, 0, 0], velocity: [0, w*r0, 0]}
holonomic:
  wire: bead.x*sin(w*t) = bead.y*cos(w*t)
"""
    )
    t = table.t
    r, push = 0.5 * np.cosh(2 * t), 3 * 2 * 2 * np.sinh(2 * t)  # m 2 w r'
    assert close(np.hypot(table["bead.x"], table["bead.y"]), r)
    assert close(table["R.bead.x"], -push * np.sin(2 * t))
    assert close(table["R.bead.y"], push * np.cos(2 * t))


# Dependent particles, x = x(q, t).

CARTESIAN_PENDULUM = """
lagcli: 1
parameters: {L: 1.3, th0: 1.1}
particles:
  a: {mass: 0.7, position: [L*sin(th0), 0, -L*cos(th0)]}
forces:
  weight: {to: a, force: [0, 0, -m*9.81]}
  drag: {to: a, force: -0.2*v}
  well: {potential: "a.x**4/4 + a.x*a.z"}
holonomic:
  rod: distance(a, [0, 0, 0]) = L
  plane: a.y = 0
"""
ANGLE_PENDULUM = """
lagcli: 1
parameters: {L: 1.3, th0: 1.1}
coordinates: {th: {value: th0}}
particles:
  a: {mass: 0.7, position: "[L*sin(th), 0, -L*cos(th)]"}
forces:
  weight: {to: a, force: [0, 0, -m*9.81]}
  drag: {to: a, force: -0.2*v}
  well: {potential: "a.x**4/4 + a.x*a.z"}
"""


def test_reaction_of_a_dependent_particle_is_that_of_multipliers():
    cartesian = run(CARTESIAN_PENDULUM, duration=3, samples=31)
    angle = run(ANGLE_PENDULUM, duration=3, samples=31)
    for axis in "xyz":
        assert close(angle[f"a.{axis}"], cartesian[f"a.{axis}"])
        assert close(angle[f"a.v{axis}"], cartesian[f"a.v{axis}"])
        assert close(angle[f"R.a.{axis}"], cartesian[f"R.a.{axis}"])
    assert close(angle["energy"], cartesian["energy"])
    assert np.abs(cartesian.reaction("a")).max() > 1


def test_reaction_of_a_driven_particle():
    # x = l(t) along a turning arm: m a - F from the derivatives by hand.
    table = run(
        """
lagcli: 1
parameters: {w: 3}
coordinates: {u: {value: 1, rate: 0.5}}
particles:
  a: {mass: 2, position: "[u*cos(w*t), u*sin(w*t), t**3]"}
forces:
  weight: {to: a, force: [0, 0, -m*9.81]}
  spring: {potential: "20*u**2/2"}
"""
    )
    t, u, ud = table.t, table["u"], table["rate(u)"]
    # u'' = w^2 u - 10 u = -u; R holds the unknown carrier of the spring in u.
    assert close(u, np.cos(t) + 0.5 * np.sin(t))
    radial, across = 2 * (-u - 9 * u), 2 * 6 * ud
    assert close(table["R.a.x"], radial * np.cos(3 * t) - across * np.sin(3 * t))
    assert close(table["R.a.y"], radial * np.sin(3 * t) + across * np.cos(3 * t))
    assert close(table["R.a.z"], 2 * (6 * t + G))


@pytest.mark.parametrize(
    ("extra", "warned"),
    [
        ("  motor: {to: th, force: 0.3}", True),
        ('  spring: {potential: "th**2/2"}', True),
        ("  motor: {to: other, force: 0.3}", False),
        ('  spring: {potential: "a.x**2/2"}', False),
        ("  push: {to: a, force: [1, t, 0]}", False),
    ],
)
def test_reaction_that_includes_a_drive_is_warned_of(extra, warned):
    text = ANGLE_PENDULUM.replace("coordinates: {", "coordinates: {other: {}, ").replace(
        "forces:\n", f"lagrangian: rate(other)**2/2\nforces:\n{extra}\n"
    )
    found = lagcli.check(lagcli.loads(text)).warnings
    assert ("reaction-includes-drive" in codes(found)) == warned


def test_lagrangian_of_a_carried_coordinate_is_a_drive_too():
    text = ANGLE_PENDULUM.replace("forces:\n", "lagrangian: -th**2\nforces:\n")
    (warning,) = [w for w in lagcli.check(lagcli.loads(text)).warnings if w.code == "reaction-includes-drive"]
    assert "`a`" in warning.message
    assert "lagrangian" in warning.message


# Outputs and energies.


def test_outputs_see_multipliers_reactions_and_energies():
    text = CARTESIAN_PENDULUM + (
        "outputs:\n  pull: -multiplier(rod)\n  push: reaction(a)\n  T: kinetic\n  V: potential\n"
        "  power: dot(reaction(a), a.v)\n  twice: 2*pull\n"
    )
    table = run(text, duration=2)
    x, z = table["a.x"], table["a.z"]
    speed2 = sum(table[f"a.v{axis}"] ** 2 for axis in "xyz")
    assert np.array_equal(table["pull"], -table["lambda.rod"])
    assert np.array_equal(np.stack([table[f"push.{c}"] for c in "xyz"], axis=1), table.reaction("a"))
    assert close(table["T"], 0.7 * speed2 / 2)
    assert close(table["V"], 0.7 * G * z + x**4 / 4 + x * z)
    assert np.array_equal(table["energy"], table["T"] + table["V"])
    assert np.array_equal(table["twice"], 2 * table["pull"])
    assert np.abs(table["power"]).max() <= 1e-12 * np.abs(table["pull"]).max()


def test_energy_of_a_lagrangian_is_its_jacobi_function():
    text = """
lagcli: 1
coordinates: {x: {value: 1}, y: {rate: 0.5}}
lagrangian: (rate(x)**2 + 3*rate(y)**2)/2 + 2*x*rate(y) - 5*x**2/2 - y**2
"""
    table = run(text, duration=4)
    expected = (
        (table["rate(x)"] ** 2 + 3 * table["rate(y)"] ** 2) / 2 + 5 * table["x"] ** 2 / 2 + table["y"] ** 2
    )
    assert close(table["energy"], expected)
    assert close(table["energy"], np.full(11, table["energy"][0]))
    assert np.ptp(table["rate(y)"]) > 0.1


def test_lagrangian_adds_to_particles_and_potentials():
    table = run(
        """
lagcli: 1
coordinates: {s: {value: 0.2}}
particles:
  a: {mass: 2, position: "[s, 0, 0]"}
forces:
  spring: {potential: "10*a.x**2/2"}
lagrangian: 3*rate(s)**2/2 - 40*s**2/2
outputs: {T: kinetic, V: potential}
"""
    )
    s, sd = table["s"], table["rate(s)"]
    assert close(s, 0.2 * np.cos(np.sqrt(50 / 5) * table.t))
    assert close(table["T"], sd**2)
    assert close(table["V"], 5 * s**2)
    assert close(table["energy"], 5 * sd**2 / 2 + 25 * s**2)


def test_inertia_that_depends_on_the_coordinates():
    # A bead on a parabola, x = u, z = u^2/2, without weight: its speed stays.
    table = run(
        """
lagcli: 1
coordinates: {u: {value: -1, rate: 2}}
lagrangian: rate(u)**2*(1 + u**2)/2
""",
        duration=2,
    )
    assert close(table["rate(u)"] ** 2 * (1 + table["u"] ** 2), np.full(11, 8.0))
    assert table["u"][-1] > 1


# Parameters.

TUNED = """
lagcli: 1
parameters: {m: 2, k: 3, L: 1, th0: "L*0.4", n: 2}
coordinates:
  th: {value: th0, rate: 0.1}
particles:
  a: {mass: m, position: "[L*sin(th), 0, -L*cos(th)]"}
  b: {mass: 1, position: [L, 1, 0]}
forces:
  weight: {to: a, force: [0, 0, -m*9.81]}
  spring: {potential: "k*abs(b.x - 0.5)**n/n"}
holonomic:
  rail: b.y = 1
  height: b.z = b.x - L
"""


@pytest.mark.parametrize(
    ("changes", "fresh"),
    [
        ({"m": 5}, [("m: 2", "m: 5")]),
        ({"k": "7/2", "L": 1.5}, [("k: 3", "k: 3.5"), ("L: 1,", "L: 1.5,")]),
        ({"n": 4}, [("n: 2", "n: 4")]),
        ({"n": 2.5}, [("n: 2", "n: 2.5")]),
        ({"th.value": "pi/3"}, [("value: th0", "value: pi/3")]),
        ({"th.rate": -2, "th0": 0.3}, [("rate: 0.1", "rate: -2"), ('"L*0.4"', "0.3")]),
    ],
)
def test_changed_values_equal_a_fresh_model(changes, fresh):
    lagcli.simulate(lagcli.loads(TUNED), duration=0.1)
    text = functools.reduce(lambda whole, swap: whole.replace(*swap), fresh, TUNED)
    assert text != TUNED
    changed = lagcli.simulate(lagcli.loads(TUNED, parameters=changes), duration=1, samples=11)
    expected = lagcli.simulate(lagcli.loads(text), duration=1, samples=11)
    assert np.array_equal(changed.rows, expected.rows)
    assert not np.allclose(changed.rows, run(TUNED).rows)


def test_other_values_need_no_new_build():
    text = TUNED + "title: built once\n"
    first, second = (
        cache.compiled(lagcli.loads(text, parameters=p)) for p in (None, {"m": 4, "th.value": 1})
    )
    assert second.numeric is first.numeric
    dop853 = method.METHODS["dop853"]()
    assert second.cached.plain.scheme(dop853) is first.cached.plain.scheme(dop853)
    anew = cache.compiled(lagcli.loads(text, parameters={"n": 3}))
    assert anew.numeric is not first.numeric


def test_second_run_spends_next_to_nothing_on_the_build():
    text = TUNED + "title: timed\n"
    first = lagcli.simulate(lagcli.loads(text), duration=0.1).stats.compile_seconds
    again = [lagcli.simulate(lagcli.loads(text, parameters={"m": m}), duration=0.1) for m in (3, 4, 5)]
    assert min(run.stats.compile_seconds for run in again) < first / 3


def test_a_start_that_was_examined_is_not_examined_again_for_other_rows_and_tolerances(monkeypatch):
    examined = []
    examine = examined_start.examine
    monkeypatch.setattr(examined_start, "examine", lambda *args: examined.append(args) or examine(*args))
    text = TUNED + "title: examined once\n"
    first = lagcli.simulate(lagcli.loads(text), duration=1, samples=11)
    lagcli.simulate(lagcli.loads(text), duration=1, samples=21, rtol=1e-6)
    again = lagcli.simulate(lagcli.loads(text), duration=1, samples=11)
    assert len(examined) == 1
    assert np.array_equal(again.rows, first.rows)
    for change in ({"m": 5}, {"th.rate": 0.2}, {"L": 1.5}):
        lagcli.simulate(lagcli.loads(text, parameters=change), duration=1)
    lagcli.simulate(lagcli.loads(text), duration=2)
    lagcli.simulate(lagcli.loads(text), duration=1, start=3)
    lagcli.simulate(lagcli.loads(text), duration=1, assemble=True)
    assert len(examined) == 7
