"""What outputs may read besides the motion: accelerations, and the part of one constraint in a reaction."""

from __future__ import annotations

import numpy as np
import pytest

import lagcli
from lagcli.errors import diagnostics

# A ball on a moving table, tied to a rider that follows an angle: Cartesian and dependent, rows that move.
MIXED = """\
lagcli: 1
parameters: {k: 3, g: 9.81}
coordinates: {theta: {value: 60*deg, rate: 0.2}}
particles:
  b: {mass: 2, position: [0, 0, -1], velocity: [1, 0.5, 0]}
  c: {mass: 3, position: "[sin(theta), 0, 2 + cos(theta) + t**2/4]"}
forces:
  weight: {to: all, force: "[0, 0, -m*g]"}
  spring: {potential: "k/2*b.y**2"}
holonomic:
  rod: norm(b) = 1
  tie: distance(b, c) = sqrt(13) + t/10
outputs:
  a: [0, 0, 0]
simulation: {assemble: true, duration: 1, samples: 101}
"""


def run(text: str, outputs: str, **options):
    return lagcli.simulate(lagcli.loads(text.replace("  a: [0, 0, 0]\n", outputs)), **options)


def columns(found, *names: str) -> np.ndarray:
    """Columns of a run beside each other, (T, len(names))."""
    return np.column_stack([found[name] for name in names])


def vector(found, name: str) -> np.ndarray:
    return columns(found, *(f"{name}.{axis}" for axis in "xyz"))


ACCELERATIONS = """\
  ab: b.a
  abx: b.ax
  twice: rate(b.z, 2)
  ac: c.a
  again: rate(c, 2)
  angle: rate(theta, 2)
  once: rate(theta, 1)
"""


def test_accelerations_are_those_of_newton_and_of_the_motion() -> None:
    """m a = F + R of a Cartesian particle, and the slopes of the velocity columns of all."""
    found = run(MIXED, ACCELERATIONS)
    force = np.zeros((found.t.size, 3))
    force[:, 1], force[:, 2] = -3 * found["b.y"], -2 * 9.81
    np.testing.assert_allclose(2 * vector(found, "ab"), force + vector(found, "R.b"), rtol=0, atol=1e-11)
    np.testing.assert_allclose(found["abx"], found["ab.x"], rtol=0, atol=0)
    np.testing.assert_allclose(found["twice"], found["ab.z"], rtol=0, atol=0)
    np.testing.assert_allclose(vector(found, "again"), vector(found, "ac"), rtol=0, atol=0)
    np.testing.assert_allclose(found["once"], found["rate(theta)"], rtol=0, atol=0)
    weight = np.array([0.0, 0.0, -3 * 9.81])
    np.testing.assert_allclose(3 * vector(found, "ac"), weight + vector(found, "R.c"), rtol=0, atol=1e-11)
    step = found.t[1] - found.t[0]
    pairs = [("ab.x", "b.vx"), ("ab.y", "b.vy"), ("ac.x", "c.vx"), ("ac.z", "c.vz"), ("angle", "rate(theta)")]
    for acceleration, velocity in pairs:
        v, a = found[velocity], found[acceleration]
        # Five points: the error is h**4/30 of the fifth derivative.
        slopes = (v[:-4] - 8 * v[1:-3] + 8 * v[3:-1] - v[4:]) / (12 * step)
        np.testing.assert_allclose(a[2:-2], slopes, rtol=0, atol=1e-5 * np.abs(a).max())


def test_a_reaction_is_the_sum_of_the_parts_of_its_constraints() -> None:
    outputs = (
        "  rod: reaction(b, rod)\n  tie: reaction(b, tie)\n  on_c: reaction(c, tie)\n  pull: reaction(b).x\n"
        "  rest: (reaction(b) - reaction(b, rod) - reaction(b, tie)).z\n"
    )
    found = run(MIXED, outputs.replace("  rod:", "  one:").replace("  tie:", "  two:"))
    b, c = vector(found, "b"), vector(found, "c")
    rod = found["lambda.rod"][:, None] * b / np.linalg.norm(b, axis=1)[:, None]
    tie = found["lambda.tie"][:, None] * (b - c) / np.linalg.norm(b - c, axis=1)[:, None]
    np.testing.assert_allclose(vector(found, "one"), rod, rtol=0, atol=1e-10)
    np.testing.assert_allclose(vector(found, "two"), tie, rtol=0, atol=1e-10)
    np.testing.assert_allclose(vector(found, "on_c"), -tie, rtol=0, atol=1e-10)
    np.testing.assert_allclose(rod + tie, vector(found, "R.b"), rtol=0, atol=1e-10)
    np.testing.assert_allclose(found["pull"], found["R.b.x"], rtol=0, atol=0)
    np.testing.assert_allclose(found["rest"], 0.0, atol=1e-10)


CHAIN = """\
lagcli: 1
parameters: {N: 6}
particles:
  p[i]: {for: "i = 1..N", mass: i, position: "[i, 0, 0]"}
forces:
  weight: {to: p, force: [0, 0, -m]}
holonomic:
  hook: "p[1] = [1, 0, 0]"
  link[i]: {for: "i = 2..N", equation: "distance(p[i], p[i-1]) = 1"}
outputs:
  left[i]: {for: "i = 2..N", expression: "reaction(p[i], link[i]).x"}
  right[i]: {for: "i = 2..N-1", expression: "reaction(p[i], link[i+1]).x"}
  sag[i]: {for: "i = 1..N", expression: "p[i].az"}
  all[i]: {for: "i = 1..N", expression: "reaction(p[i], hook)"}
  side: reaction(p[1], hook.x)
  none: reaction(p[4], link[2])
simulation: {duration: 0.7, samples: 15}
""".replace("  all[i]", "  held[i]")


def test_parts_and_accelerations_of_families() -> None:
    found = lagcli.simulate(lagcli.loads(CHAIN))
    for i in range(2, 7):
        parts = found[f"left[{i}]"] + (found[f"right[{i}]"] if i < 6 else 0.0)
        np.testing.assert_allclose(parts, found[f"R.p[{i}].x"], rtol=0, atol=1e-11)
        gap = found[f"p[{i}].x"] - found[f"p[{i - 1}].x"]
        np.testing.assert_allclose(found[f"left[{i}]"], found[f"lambda.link[{i}]"] * gap, rtol=0, atol=1e-11)
        np.testing.assert_allclose(i * found[f"sag[{i}]"], found[f"R.p[{i}].z"] - i, rtol=0, atol=1e-11)
        assert not vector(found, f"held[{i}]").any()
    hook = columns(found, *(f"lambda.hook.{axis}" for axis in "xyz"))
    np.testing.assert_allclose(vector(found, "held[1]"), hook, rtol=0, atol=0)
    np.testing.assert_allclose(found["side.x"], hook[:, 0], rtol=0, atol=0)
    assert not vector(found, "none").any()
    assert not columns(found, "side.y", "side.z").any()


BODY = """\
lagcli: 1
coordinates: {phi: {rate: 1}}
particles:
  a: {mass: 1, position: [0, 0, 0], velocity: [0, 0.5, 0]}
  b: {mass: 2, position: [1, 0, 0]}
  c: {mass: 1, position: [0, 1, 0.5]}
  d: {mass: 1, position: [0.3, 0.3, 1]}
  e: {mass: 1, position: [1, 1, 1]}
lagrangian: rate(phi)**2/2
rigid: {body: [a, b, c, d, e]}
holonomic: {pin: "b = [1, 0, 0]"}
differential: {skate: d(a.x) = 0.1*d(phi)}
forces: {weight: {to: all, force: [0, 0, -m]}}
outputs:
  ofa: reaction(a, body)
  ofb: reaction(b, body) + reaction(b, pin)
  ofe: reaction(e, body)
  edge: reaction(a, body.1)
  blade: reaction(a, skate)
simulation: {duration: 0.4, samples: 5, assemble: true}
"""


def test_a_body_acts_with_the_sum_of_its_rows_and_a_differential_row_with_its_own() -> None:
    found = lagcli.simulate(lagcli.loads(BODY))
    total = vector(found, "ofa") + vector(found, "blade")
    np.testing.assert_allclose(total, vector(found, "R.a"), rtol=0, atol=1e-11)
    np.testing.assert_allclose(vector(found, "ofb"), vector(found, "R.b"), rtol=0, atol=1e-11)
    np.testing.assert_allclose(vector(found, "ofe"), vector(found, "R.e"), rtol=0, atol=1e-11)
    np.testing.assert_allclose(found["blade.x"], found["lambda.skate"], rtol=0, atol=1e-12)
    along = vector(found, "a") - vector(found, "b")
    expected = found["lambda.body.1"][:, None] * along / np.linalg.norm(along, axis=1)[:, None]
    np.testing.assert_allclose(vector(found, "edge"), expected, rtol=0, atol=1e-11)


DEPENDENT = """\
lagcli: 1
coordinates: {x: {rate: 1}, s: {value: 1, rate: 1}}
particles:
  p[i]: {for: "i = 1..3", mass: 1, position: "[x + i, s**2*i, 0]"}
  q: {mass: 1, position: "[s, 0, 0]"}
  fix: {mass: 1, position: [5, 5, 0], velocity: [1, 2, 0]}
  w: {mass: 1, position: [5, 4, 0], velocity: [1, 1, 0]}
holonomic:
  level: x = s - 1
differential:
  roll: d(p[2].y) = s*d(q.x) + 3*d(fix.x)
outputs:
  probe: EXPRESSION
simulation: {duration: 0.1, samples: 3}
"""


def test_a_constraint_acts_on_dependent_particles_that_its_equation_names() -> None:
    found = lagcli.simulate(lagcli.loads(DEPENDENT.replace("EXPRESSION", "reaction(p[2], roll)")))
    np.testing.assert_allclose(
        vector(found, "probe"), [[0, lam, 0] for lam in found["lambda.roll"]], atol=1e-12
    )
    found = lagcli.simulate(lagcli.loads(DEPENDENT.replace("EXPRESSION", "reaction(q, roll)")))
    slope = -found["s"] * found["lambda.roll"]
    np.testing.assert_allclose(found["probe.x"], slope, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("expression", "name"),
    [("reaction(q, level)", "q"), ("reaction(p[2], level)", "p[2]"), ("reaction(p[1], roll)", "p[1]")],
)
def test_a_share_that_is_not_determined_is_refused(expression: str, name: str) -> None:
    """`level` moves q and the p[i], but its equation names none of them."""
    with pytest.raises(diagnostics.ModelError) as caught:
        lagcli.simulate(lagcli.loads(DEPENDENT.replace("EXPRESSION", expression)))
    (found,) = caught.value.diagnostics
    assert found.code == "share-not-determined"
    assert f"does not name `{name}`" in found.message


def test_formulations_agree_on_what_outputs_read() -> None:
    text = MIXED.replace(
        "  a: [0, 0, 0]\n",
        "  x: b.a\n  y: reaction(b, tie)\n  z: c.a\n  w: rate(theta, 2)\n  u: reaction(c, tie)\n",
    )
    found = lagcli.compare(lagcli.loads(text), duration=0.3)
    assert found.agree
    assert len(found.formulations) >= 2
    assert all("outputs" in each for each in found.agreements)


REFUSED = [
    ("forces:\n  f: {to: b, force: [-b.ax, 0, 0]}\n", "result-not-allowed", "into the mass"),
    ("definitions:\n  f: rate(theta, 2)\n", "result-not-allowed", "under `outputs`"),
    ("differential:\n  f: b.ax = 1\n", "result-not-allowed", "in velocities"),
    ("holonomic:\n  f: b.az = 1\n", "result-not-allowed", "in velocities"),
    ("lagrangian: rate(theta, 2)\n", "result-not-allowed", "under `outputs`"),
    ("outputs:\n  f: rate(theta, 3)\n", "bad-rate", "`rate(theta, 2)` its acceleration"),
    ("outputs:\n  f: rate(b.vx)\n", "bad-rate", "write `a.ax`"),
    ("outputs:\n  f: rate(rate(theta))\n", "bad-rate", "`rate(theta, 2)`"),
    ("outputs:\n  f: reaction(rod)\n", "wrong-arguments", "`reaction(a, rod)`"),
    ("outputs:\n  f: reaction(b, rot)\n", "unknown-constraint", "did you mean `rod`?"),
    ("outputs:\n  f: reaction(b, rod, rod)\n", "wrong-arguments", ""),
    ("outputs:\n  f: reaction(b, rod.x)\n", "unknown-constraint", "one row"),
    ("outputs:\n  f: multiplier(b)\n", "unknown-constraint", "`reaction(...)`"),
    ("outputs:\n  f: reaction(theta)\n", "wrong-arguments", "`R.theta`"),
    ("outputs:\n  f: reaction(b).vx\n", "unknown-component", "`.x` `.y` `.z`"),
    ("outputs:\n  f: norm(b).x\n", "not-a-vector", ""),
]


@pytest.mark.parametrize(("addition", "code", "hint"), REFUSED)
def test_what_has_no_such_result_is_refused_with_a_way_out(addition: str, code: str, hint: str) -> None:
    base = (
        "lagcli: 1\ncoordinates: {theta: {}}\nparticles:\n  b: {mass: 1, position: [0, 0, -1]}\n"
        "  c: {mass: 1, position: '[sin(theta), cos(theta), 0]'}\n"
    )
    rod = "  rod: norm(b) = 1\n"
    if addition.startswith("holonomic:"):
        text = base + addition + rod
    else:
        text = base + "holonomic:\n" + rod + addition
    with pytest.raises(diagnostics.ModelError) as caught:
        lagcli.loads(text)
    (found,) = caught.value.diagnostics
    assert found.code == code
    assert hint in found.hint


def test_degrees_are_known_unless_a_file_has_a_name_of_its_own() -> None:
    text = "lagcli: 1\nparameters: {a: 30*deg%s}\ncoordinates: {q: {value: a}}\nlagrangian: rate(q)**2\n"
    assert lagcli.loads(text % "").parameters[0].value == pytest.approx(np.pi / 6, rel=1e-15)
    own = text.replace("a: 30*deg%s", "deg: 2, a: 30*deg")
    assert lagcli.loads(own).parameters[1].value == 60.0
    with pytest.raises(diagnostics.ModelError, match="used-before-declared"):
        lagcli.loads(text % ", deg: 2")


@pytest.mark.parametrize(
    "own",
    [
        "coordinates: {deg: {value: 2}}",
        "definitions: {deg: 1 + q}",
        "particles: {deg: {mass: 1, position: [1, 1, 1]}}",
    ],
)
def test_a_name_deg_of_any_kind_is_the_files(own: str) -> None:
    text = (
        f"lagcli: 1\ncoordinates: {{q: {{value: 1}}}}\nlagrangian: rate(q)**2\n{own}\noutputs: {{o: deg}}\n"
    )
    if own.startswith("coordinates"):
        text = text.replace("coordinates: {q: {value: 1}}", "coordinates: {q: {value: 1}, deg: {value: 2}}")
        text = text.replace(f"{own}\n", "").replace("rate(q)**2", "rate(q)**2 + rate(deg)**2")
    found = lagcli.simulate(lagcli.loads(text), duration=0.1)
    assert found["o.x" if own.startswith("particles") else "o"][0] == pytest.approx(
        1.0 if "particles" in own else 2.0
    )


def test_degrees_mean_the_same_to_every_part() -> None:
    """The row of the integrator, the algebra that recovers its integral, the derivation and the audit."""
    text = (
        "lagcli: 1\nparticles:\n  a: {mass: 1, position: [0, 0, 0], velocity: [1, 0, 0]}\n"
        "differential:\n  slope: cos(60*deg)*d(a.y) = sin(60*deg)*d(a.z)\n  still: d(a.z) = t*0\n"
    ).replace("  still: d(a.z) = t*0\n", "")
    model = lagcli.loads(text)
    report = lagcli.check(model)
    assert report.constraints[0].as_json()["verdict"] == "exact"
    assert "sqrt(3)" in lagcli.derive(model).text() or "√3" in lagcli.derive(model).text()
    assert lagcli.audit(model, lagcli.simulate(model, duration=0.5)).passed
