"""Reading a model: what a good file becomes, and what is said about a bad one, where, all in one go."""

from __future__ import annotations

import math
import pathlib

import pytest

from lagcli.errors import diagnostics
from lagcli.input import document, keys, overrides
from lagcli.model import model, settings
from lagcli.simulation.scheme import step_tolerance
from tests.helpers.spent import at_most_calls

GALLERY = sorted((pathlib.Path(__file__).parents[2] / "models").glob("*.yaml"))

HEAD = "lagcli: 1\n"
BALL = HEAD + "particles:\n  a: {mass: 1, position: [1, 0, 0]}\n"
FAMILY = HEAD + "parameters: {N: 3}\nparticles:\n  p[i]: {for: i = 1..N, mass: 1, position: '[i, 0, 0]'}\n"
ANGLE = HEAD + "coordinates:\n  q: {value: 0.5}\nparticles:\n  a: {mass: 1, position: [sin(q), 0, -cos(q)]}\n"


def read(text: str, **changes: object) -> model.Model:
    return document.read(
        text, "model.yaml", {name.replace("__", "."): value for name, value in changes.items()}
    )


def errors_of(text: str, **changes: object) -> tuple[diagnostics.Diagnostic, ...]:
    with pytest.raises(diagnostics.ModelError) as caught:
        read(text, **changes)
    return caught.value.diagnostics


def spots(text: str, **changes: object) -> list[tuple[str, int, str]]:
    """Code, line and the text under the carets of every error."""
    found = []
    for error in errors_of(text, **changes):
        at = error.location
        found.append((error.code, at.line, at.source_line[at.column - 1 : at.column - 1 + at.length]))
    return found


# What a good file becomes.


def test_the_gallery_is_there_and_reads_without_a_word() -> None:
    assert len(GALLERY) > 15
    for path in GALLERY:
        assert document.read(path.read_bytes(), path.name).warnings == ()


def test_parameters_are_evaluated_in_their_order() -> None:
    read_model = read(
        BALL + "parameters: {L: 2, twice: 2*L, e: [L, 0, twice], far: 'norm(e)', y: 1e3, d: pi}\n"
    )
    assert {p.name: p.value for p in read_model.parameters} == {
        "L": 2.0, "twice": 4.0, "e": (2.0, 0.0, 4.0), "far": math.sqrt(20.0), "y": 1000.0, "d": math.pi,
    }  # fmt: skip


def test_a_particle_is_cartesian_or_dependent_by_what_its_position_reads() -> None:
    text = HEAD + (
        "parameters: {L: 2}\ncoordinates: {q: {rate: 3}}\nparticles:\n"
        "  a: {mass: 2*L, position: [L, 0, 1], velocity: '[0, L, 0]'}\n"
        "  b: {mass: 1, position: [L*q, 0, 0]}\n"
        "  c: {mass: 1, position: [0, t, 0]}\n"
        "  d: {mass: 1, position: 'b + [0, 0, half]'}\n"
        "definitions: {half: q/2, later: b.x + half}\n"
    )
    read_model = read(text)
    a, b, c, d = read_model.particles
    assert a.start is not None
    assert (a.mass_values.tolist(), a.start.tolist(), a.start_velocity.tolist()) == (
        [4.0], [[2.0, 0.0, 1.0]], [[0.0, 2.0, 0.0]],
    )  # fmt: skip
    assert [p.is_dependent for p in (a, b, c, d)] == [False, True, True, True]
    assert read_model.coordinate_names == ("a.x", "a.y", "a.z", "q")
    (q,) = read_model.coordinates
    assert (q.value.tolist(), q.rate.tolist()) == ([0.0], [3.0])


def test_constraints_keep_the_order_of_the_file_and_name_their_rows() -> None:
    text = BALL + (
        "  b: {mass: 1, position: [2, 0, 0]}\n"
        "differential:\n  w: d(a.x) + a.y*dt\n  v: {equation: 'a.v = [1, 0, 0]'}\n"
        "holonomic:\n  z: a.z = 0\n  p: 'a = [1, 0, 0]'\n  o: '[a.x, 0, 0] = 0'\n"
        "rigid:\n  stick: [b, a]\n"
    )
    laws = list(read(text).constraints())
    names = [law.name if isinstance(law, model.RigidBody) else law.members.base for law in laws]
    assert names == ["z", "p", "o", "stick", "w", "v"]
    assert [law.rows for law in laws if not isinstance(law, model.RigidBody)] == [
        ("z",), ("p.x", "p.y", "p.z"), ("o.x", "o.y", "o.z"), ("w",), ("v.x", "v.y", "v.z"),
    ]  # fmt: skip
    forms = [law.form for law in laws if isinstance(law, model.Differential)]
    assert forms == ["differentials", "velocities"]


def test_forces_are_told_apart_by_their_targets() -> None:
    text = ANGLE + (
        "forces:\n"
        "  weight: {to: all, force: [0, 0, -m*9.81]}\n"
        "  drag: {to: [a, a], force: -2*v}\n"
        "  motor: {to: q, force: sin(t)}\n"
        "  spring: {potential: q**2/2}\n"
    )
    weight, drag, motor, spring = read(text).forces
    assert isinstance(weight, model.ParticleForce)
    assert isinstance(drag, model.ParticleForce)
    assert (weight.action.targets.tolist(), weight.constant) == ([0], True)
    assert (drag.action.targets.tolist(), drag.constant) == ([0], False)
    assert isinstance(motor, model.GeneralizedForce)
    assert isinstance(spring, model.Potential)


def test_settings_have_the_defaults_of_the_format() -> None:
    assert read(BALL).simulation == settings.Simulation()
    run = read(
        BALL + "parameters: {T: 3}\nsimulation: {duration: 2*T, output_step: 0.1, keep: [a.x, a]}\n"
    ).simulation
    assert (run.duration, run.output_step, run.keep, run.samples) == (6.0, 0.1, ("a.x", "a"), 1001)
    default = settings.Simulation()
    declared = {key.name: key.default for key in keys.FORMAT.key("simulation").keys if key.default}
    # The default of atol is no number: it follows the motion.
    assert default.atol is None
    assert declared.pop("atol") == f"{step_tolerance.PARAMETERS.default:g} of the sizes of the motion"
    assert {name: str(getattr(default, name)).removesuffix(".0").lower() for name in declared} == declared


def test_empty_sections_are_as_good_as_absent() -> None:
    names = [key.name for key in keys.FORMAT.keys if key.name not in ("lagcli", "particles")]
    assert read(BALL + "".join(f"{name}:\n" for name in names)).forces == ()


def test_names_that_are_words_of_python_or_functions_work() -> None:
    text = (
        HEAD
        + "parameters: {lambda: 1, in: 2, is: 3, d: 4, e: 5, sin: 6, 'µ': 7, 'μ': 8}\n"
        + BALL[len(HEAD) :]
    )
    found = read(text + "outputs: {s: 'lambda + in + is + d + e + sin + sin(0) + µ - μ'}\n")
    assert len(found.parameters) == 8


# Positions and definitions may use each other in any order, but not in a circle.


def test_positions_may_use_particles_and_definitions_below() -> None:
    text = HEAD + (
        "coordinates: {q: {value: 1}}\nparticles:\n"
        "  a: {mass: 1, position: 'b + [0, 0, shift]'}\n  b: {mass: 1, position: [q, 0, 0]}\n"
        "definitions: {shift: b.x*2}\n"
    )
    found = read(text)
    assert all(p.is_dependent for p in found.particles)
    b, shift, a = found.order
    assert isinstance(a, model.Batch)
    assert isinstance(b, model.Batch)
    assert (b.entry, shift, a.entry) == (1, "shift", 0)


@pytest.mark.parametrize("count", [3000])
def test_long_chains_need_no_deep_stack(count: int) -> None:
    chain = "".join(f"  p{i}: {{mass: 1, position: 'p{i + 1} + [1, 0, 0]'}}\n" for i in range(count))
    text = (
        HEAD + f"coordinates: {{q: {{}}}}\nparticles:\n{chain}  p{count}: {{mass: 1, position: [q, 0, 0]}}\n"
    )
    assert len(read(text).particles) == count + 1
    definitions = "".join(f"  d{i}: d{i - 1} + 1\n" for i in range(1, count))
    text = HEAD + f"coordinates: {{q: {{}}}}\nparticles: {{a: {{mass: 1, position: [d{count - 1}, 0, 0]}}}}\n"
    assert len(read(text + "definitions:\n  d0: q\n" + definitions).definitions) == count


def test_a_circle_is_reported_once() -> None:
    text = HEAD + (
        "coordinates: {q: {}}\nparticles:\n"
        "  a: {mass: 1, position: [b.x, 0, 0]}\n  b: {mass: 1, position: [c.x, 0, 0]}\n"
        "  c: {mass: 1, position: [a.x + q, 0, 0]}\n"
    )
    assert [(code, spot) for code, _, spot in spots(text)] == [("circular", "a")]


@pytest.mark.parametrize(
    ("text", "line", "spot"),
    [
        (BALL + "parameters:\n  p: 2*q\n  q: 1\n", 5, "q"),
        (BALL + "definitions:\n  p: 2*q\n  q: a.x\n", 5, "q"),
        (BALL + "definitions:\n  p: 2*p\n", 5, "p"),
        (BALL + "outputs:\n  p: 2*q\n  q: a.x\n", 5, "q"),
        (BALL + "parameters:\n  p: 2*p\n", 5, "p"),
    ],
)
def test_parameters_definitions_and_outputs_use_earlier_ones(text: str, line: int, spot: str) -> None:
    assert spots(text) == [("used-before-declared", line, spot)]


# m, r, v of a particle.


def test_the_own_mass_position_and_velocity_stand_for_themselves() -> None:
    found = read(BALL + "forces:\n  f: {to: a, force: '-m*r - 2*v + [v.x, r.y, m]'}\n")
    assert found.warnings == ()
    assert [code for code, _, _ in spots(BALL + "outputs: {k: m*r.x}\n")] == ["unknown-name"] * 2


@pytest.mark.parametrize(
    ("text", "count"),
    [
        (BALL + "parameters: {m: 1}\nforces: {f: {to: a, force: [m, 0, 0]}}\n", 0),
        (BALL + "parameters: {m: 2}\nforces: {f: {to: a, force: [m, 0, 0]}}\n", 1),
        (BALL + "parameters: {v: 2}\nforces: {f: {to: a, force: [v.x, 0, 0]}}\n", 1),
        (BALL + "parameters: {v: 2}\nforces: {f: {to: a, force: [1, 0, 0]}}\n", 0),
        (BALL + "definitions: {r: a.x}\nforces: {f: {to: a, force: r}}\n", 1),
        (BALL + "outputs: {v: a.vx}\nforces: {f: {to: a, force: -v}}\n", 0),
    ],
)
def test_a_shadowed_name_is_a_warning_where_it_differs(text: str, count: int) -> None:
    assert [w.code for w in read(text).warnings] == ["shadowed-name"] * count


# What is said about a bad file.


@pytest.mark.parametrize(
    ("text", "code", "line", "spot"),
    [
        # the document
        ("particles: {}\n", "missing-key", 1, "particles: {}"),
        ("lagcli: 2\n" + BALL[len(HEAD) :], "unknown-version", 1, "2"),
        (HEAD + "parameters: {L: 1}\n", "nothing-to-move", 1, "lagcli: 1"),
        (BALL + "partcles: {}\n", "unknown-key", 4, "partcles"),
        (BALL + "forces: [a]\n", "not-a-mapping", 4, "[a]"),
        (BALL + "forces: {f: a}\n", "not-a-mapping", 4, "a"),
        (BALL + "title: [a]\n", "not-a-text", 4, "[a]"),
        (BALL + "units: {lenght: m}\n", "unknown-key", 4, "lenght"),
        # families
        (FAMILY + "outputs: {x: p.x}\n", "family-needs-index", 5, "p"),
        (FAMILY + "outputs: {x: 'p[4].x'}\n", "no-such-member", 5, "p[4].x"),
        (FAMILY + "outputs: {x: 'p[1][2].x'}\n", "no-such-member", 5, "p[1][2].x"),
        (FAMILY + "outputs: {x: 'p[1/2].x'}\n", "not-a-whole-number", 5, "1/2"),
        (FAMILY + "outputs: {x: 'p[t].x'}\n", "unknown-name", 5, "t"),
        (BALL + "holonomic:\n  c: {for: i = 1..3, equation: a.x = i}\n", "bad-range", 5, "c"),
        (BALL + "holonomic:\n  'c[i]': {equation: a.x = i}\n", "unknown-name", 5, "i"),
        (BALL + "outputs: {x: 'a[1].x'}\n", "not-a-family", 4, "a[1].x"),
        # names
        (BALL + "outputs: {1st: 1}\n", "bad-name", 4, "1st"),
        (BALL + "outputs: {energy: 1}\n", "bad-name", 4, "energy"),
        (BALL + "parameters: {t: 1}\n", "bad-name", 4, "t"),
        (BALL + "holonomic: {dt: a.x = 1}\n", "bad-name", 4, "dt"),
        (HEAD + "coordinates: {R: {}}\nlagrangian: rate(R)**2\n", "bad-name", 2, "R"),
        (BALL + "outputs: {a: a.x}\n", "duplicate-name", 4, "a"),
        (BALL + "holonomic: {c: a.x = 1}\ndifferential: {c: d(a.y) = 0}\n", "duplicate-name", 5, "c"),
        (BALL + "outputs: {k: b.x}\n", "unknown-name", 4, "b"),
        (BALL + "holonomic: {c: a.x = 2*L}\n", "unknown-name", 4, "L"),
        (BALL + "forces: {f: {to: [a, b], force: [0, 0, 1]}}\n", "unknown-name", 4, "b"),
        (BALL + "rigid: {s: [a, b]}\n", "unknown-name", 4, "b"),
        (BALL + "rigid: {s: [a, a]}\n", "duplicate-name", 4, "a"),
        (BALL + "rigid: {s: [a]}\n", "too-few-particles", 4, "[a]"),
        (BALL + "rigid: {s: a}\n", "not-a-list", 4, "a"),
        (BALL + "simulation: {keep: [a.w]}\n", "unknown-name", 4, "a.w"),
        (BALL + "outputs: {k: multiplier(c)}\n", "unknown-constraint", 4, "c"),
        (BALL + "outputs: {k: reaction(c)}\n", "unknown-name", 4, "c"),
        (BALL + "outputs: {k: rate(a.vx)}\n", "bad-rate", 4, "rate(a.vx)"),
        (BALL + "outputs: {k: rate(a.x*2)}\n", "bad-rate", 4, "a.x*2"),
        # particles and coordinates
        (HEAD + "particles: {a: {position: [1, 0, 0]}}\n", "missing-key", 2, "{position: [1, 0, 0]}"),
        (HEAD + "particles: {a: {mass: 0, position: [1, 0, 0]}}\n", "mass-not-positive", 2, "0"),
        (HEAD + "particles: {a: {mass: 1 - 3, position: [1, 0, 0]}}\n", "mass-not-positive", 2, "1 - 3"),
        (HEAD + "particles: {a: {mass: 1e999, position: [1, 0, 0]}}\n", "not-finite", 2, "1e999"),
        (HEAD + "particles: {a: {mass: nan, position: [1, 0, 0]}}\n", "unknown-name", 2, "nan"),
        (HEAD + "particles: {a: {mass: 1, position: [1, 0]}}\n", "vector-length", 2, "[1, 0]"),
        (HEAD + "particles: {a: {mass: 1, position: 5}}\n", "not-a-vector", 2, "5"),
        (HEAD + "particles: {a: {mass: 1, position: [1, 0, .inf]}}\n", "syntax", 2, "."),
        (HEAD + "particles: {a: {mass: 1, position: [1, 0, 0], velocity: [t, 0, 0]}}\n", "time-not-allowed", 2, "t"),
        (ANGLE.replace("}\nparticles", ", rat: 1}\nparticles"), "unknown-key", 3, "rat"),
        (ANGLE.replace("-cos(q)]", "-cos(q)], velocity: [0, 0, 0]"), "velocity-of-dependent", 5, "[0, 0, 0]"),
        (ANGLE.replace("sin(q)", "sin(rate(q))"), "velocity-not-allowed", 5, "rate(q)"),
        (BALL + "  b: {mass: 1, position: [a.x, 0, 0]}\n", "position-not-allowed", 4, "a.x"),
        # forces
        (BALL + "forces: {f: {force: [0, 0, 1]}}\n", "missing-key", 4, "{force: [0, 0, 1]}"),
        (BALL + "forces: {f: {to: a, force: 1}}\n", "not-a-vector", 4, "1"),
        (BALL + "forces: {f: {to: a, force: [0, 1]}}\n", "vector-length", 4, "[0, 1]"),
        (BALL + "forces: {f: {to: [], force: [0, 0, 1]}}\n", "missing-value", 4, "[]"),
        (BALL + "forces: {f: {to: a, potential: a.x}}\n", "conflicting-keys", 4, "{to: a, potential: a.x}"),
        (BALL + "forces: {f: {potential: a.vx**2}}\n", "velocity-not-allowed", 4, "a.vx"),
        (ANGLE + "forces: {f: {potential: q*rate(q)}}\n", "velocity-not-allowed", 6, "rate(q)"),
        (BALL + "forces: {f: {potential: a}}\n", "not-a-scalar", 4, "a"),
        (ANGLE + "forces: {f: {to: [a, q], force: 1}}\n", "mixed-targets", 6, "[a, q]"),
        (ANGLE + "forces: {f: {to: q, force: '[1, 0, 0]'}}\n", "not-a-scalar", 6, "[1, 0, 0]"),
        (BALL + "holonomic: {c: a.z = 0}\nforces: {f: {to: a, force: '[multiplier(c), 0, 0]'}}\n",
         "result-not-allowed", 5, "multiplier(c)"),
        # constraints
        (BALL + "holonomic: {c: a.vx = 1}\n", "velocity-not-allowed", 4, "a.vx"),
        (BALL + "holonomic: {c: d(a.x) = 0}\n", "differential-not-allowed", 4, "d(a.x)"),
        (BALL + "holonomic: {c: a = 1}\n", "vector-mismatch", 4, "a = 1"),
        (BALL + "holonomic: {c: a.x = 1 = 2}\n", "syntax", 4, "="),
        (BALL + "holonomic: {c: a.x >= 1}\n", "syntax", 4, ">="),
        (BALL + "holonomic: {c: {equatoin: a.x = 1}}\n", "missing-key", 4, "{equatoin: a.x = 1}"),
        (BALL + "holonomic: {c: a.x^2 = 1}\n", "unexpected-character", 4, "^"),
        (BALL + "differential: {c: a.x = 1}\n", "no-differential", 4, "a.x = 1"),
        (BALL + "differential: {c: d(a.x) + a.y = 0}\n", "no-differential", 4, "a.y"),
        (BALL + "differential: {c: d(a.x) = a.vx}\n", "mixed-forms", 4, "a.vx"),
        (BALL + "differential: {c: a.vx**2 = 1}\n", "nonlinear-differential", 4, "a.vx**2"),
        (BALL + "differential: {c: a.y*a.vx + a.vx*a.vy = 0}\n", "nonlinear-differential", 4, "a.vx*a.vy"),
        (BALL + "differential: {c: a.vx*d(a.y) = 0}\n", "nonlinear-differential", 4, "a.vx*d(a.y)"),
        (BALL + "differential: {c: sin(d(a.x)) = 0}\n", "nonlinear-differential", 4, "sin(d(a.x))"),
        # settings
        (BALL + "simulation: {duration: 0/0}\n", "not-finite", 4, "0/0"),
        (BALL + "simulation: {duration: -1}\n", "bad-setting", 4, "-1"),
        (BALL + "simulation: {samples: 1}\n", "bad-setting", 4, "1"),
        (BALL + "simulation: {samples: 2.5}\n", "bad-setting", 4, "2.5"),
        (BALL + "simulation: {output_step: 0}\n", "bad-setting", 4, "0"),
        (BALL + "simulation: {output_step: 1e-320}\n", "bad-setting", 4, "1e-320"),
        (BALL + "simulation: {rtol: 0}\n", "bad-setting", 4, "0"),
        (BALL + "simulation: {atol: -1}\n", "bad-setting", 4, "-1"),
        (BALL + "simulation: {method: euler}\n", "bad-setting", 4, "euler"),
        (BALL + "simulation: {assemble: maybe}\n", "bad-setting", 4, "maybe"),
        # expressions
        (BALL + "outputs: {k: }\n", "missing-value", 4, "k"),
        (BALL + "outputs: {k: ''}\n", "syntax", 4, "''"),
        (BALL + "outputs: {k: [1, 2, 3]}\n", "not-an-expression", 4, "[1, 2, 3]"),
        (BALL + "outputs: {k: 9**9**9}\n", "not-finite", 4, "9**9**9"),
        (BALL + "outputs: {k: open(1)}\n", "unknown-function", 4, "open"),
        (BALL + "outputs: {k: a.__class__}\n", "unknown-component", 4, "a.__class__"),
        (BALL + "outputs: {k: __import__(a)}\n", "unknown-function", 4, "__import__"),
        (BALL + "outputs: {k: 'exec(\"1\")'}\n", "unexpected-character", 4, '"'),
        (BALL + "outputs: {k: a.x if 1 else 2}\n", "syntax", 4, "if"),
        (BALL + f"outputs: {{k: {'(' * 3000}1{')' * 3000}}}\n", "too-deep", 4, "("),
    ],
)  # fmt: skip
def test_a_bad_model_is_refused_at_its_spot(text: str, code: str, line: int, spot: str) -> None:
    assert spots(text)[0] == (code, line, spot) or (code, line, spot) in spots(text)
    if code not in ("missing-key", "nothing-to-move", "missing-value"):
        assert len(spots(text)) == 1


def test_columns_count_characters() -> None:
    (found,) = errors_of(BALL + "outputs: {größe: 1, 'θ𝛼': θθ + 1}\n")
    assert (found.location.line, found.location.column) == (4, 27)


def test_all_errors_of_a_file_come_in_one_go_and_in_its_order() -> None:
    text = (
        "lagcli: 1\n"
        "parameters: {L: 1/0, k: L}\n"
        "particles:\n"
        "  a: {mass: -1, position: [1, 0, b]}\n"
        "  c: {mass: 1, position: [1, L, 0], velocity: [1, 2]}\n"
        "forces:\n"
        "  f: {to: x, force: [0, 0, 1]}\n"
        "  g: {potential: k*a.vx}\n"
        "holonomic:\n"
        "  h: c.x = unknown\n"
        "  i: c.x = L\n"
        "differential:\n"
        "  j: d(c.x)**2 = 0\n"
        "outputs:\n"
        "  o: multiplier(h) + multiplier(none)\n"
        "  p: multiplier(nine)\n"
        "simulation: {samples: 0, rtol: 2}\n"
        "colour: red\n"
    )
    assert spots(text) == [
        ("not-finite", 2, "1/0"),
        ("mass-not-positive", 4, "-1"),
        ("unknown-name", 4, "b"),
        ("vector-length", 5, "[1, 2]"),
        ("unknown-name", 7, "x"),
        ("unknown-name", 10, "unknown"),
        ("nonlinear-differential", 13, "d(c.x)**2"),
        ("unknown-constraint", 16, "nine"),
        ("bad-setting", 17, "0"),
        ("bad-setting", 17, "2"),
        ("unknown-key", 18, "colour"),
    ]


def test_an_error_does_not_draw_others_after_it() -> None:
    text = BALL + "parameters: {L: 1 +}\nholonomic: {c: a.x = L}\noutputs: {o: multiplier(c)*L, p: o}\n"
    assert [code for code, _, _ in spots(text)] == ["syntax"]


@pytest.mark.parametrize(
    ("text", "word"),
    [
        (BALL + "partciles: {}\n", "`particles`"),
        (BALL + "outputs: {k: 'Dot(a, a)'}\n", "`dot`"),
        (BALL + "parameters: {length: 1}\noutputs: {k: lenght}\n", "`length`"),
        (BALL + "parameters: {Length: 1}\noutputs: {k: length}\n", "`Length`"),
        (BALL + "outputs: {k: sin*2}\n", "`sin(...)`"),
        (BALL + "outputs: {k: g}\n", "9.81"),
        (BALL + "simulation: {durations: 1}\n", "`duration`"),
        (BALL + "forces: {f: {to: A, force: [0, 0, 1]}}\n", "`a`"),
        (BALL + "holonomic: {rod: a.z = 0}\noutputs: {k: multiplier(rood)}\n", "`rod`"),
        (BALL + "holonomic: {c: a.vx = 0}\n", "`differential`"),
        (BALL + "holonomic: {c: [a.x, 0, 0] = a}\n", "quotes"),
        (BALL + "holonomic: {c: distance(a, [0, 0, 0]) = 1}\n", "quotes"),
        (BALL + "holonomic: {c: atan2(a.x, a.y) = 1}\n", "quotes"),
        (BALL + "forces: {f: {to: a, force: [atan2(a.x, 1), 0, 0]}}\n", "quotes"),
        (BALL + "forces: {f: {potential: 3*(distance(a, a) - 1)}}\n", "quotes"),
    ],
)
def test_hints_name_the_nearest_known_and_the_way_out(text: str, word: str) -> None:
    assert any(word in error.hint for error in errors_of(text))


# Changes from the command line and from Python.


def test_changes_are_as_if_the_file_said_so() -> None:
    text = ANGLE + "  b: {mass: M, position: [L, 0, 0]}\nparameters: {L: 3, M: 2, two: 2*L, e: [1, 0, 0]}\n"
    changed = read(
        text, M="L + 1", L=4, e=[0, 1, 0], q__value="pi/2", q__rate=1, b__y=7, b__vz="L", b__z="0.5"
    )
    values = {p.name: p.value for p in changed.parameters}
    assert values == {"M": 5.0, "L": 4.0, "two": 8.0, "e": (0.0, 1.0, 0.0)}
    (q,) = changed.coordinates
    assert (q.value.tolist(), q.rate.tolist()) == ([math.pi / 2], [1.0])
    b = changed.particles[1]
    assert b.start is not None
    assert (b.start.tolist(), b.start_velocity.tolist()) == ([[4.0, 7.0, 0.5]], [[0.0, 0.0, 4.0]])
    assert changed.fingerprint == read(text).fingerprint


def test_whole_vectors_and_empty_entries_can_be_set() -> None:
    text = HEAD + "coordinates:\n  q:\nparticles:\n  a: {mass: 1, position: '[1, 0, 0]'}\n"
    changed = read(text, a__position="[2, 0, 0]", a__velocity=(1, 2, 3), q__value=2)
    (a,) = changed.particles
    assert a.start is not None
    assert (a.start.tolist(), a.start_velocity.tolist()) == ([[2.0, 0.0, 0.0]], [[1.0, 2.0, 3.0]])
    assert changed.coordinates[0].value.tolist() == [2.0]


@pytest.mark.parametrize(
    ("name", "value", "word"),
    [
        ("MM", 1, "`M`"),
        ("q", 1, "`q.value`"),
        ("a", 1, "`a.position`"),
        ("q.rates", 1, "`q.rate`"),
        ("a.q", 1, "a.q"),
        ("M", "", "expression"),
        ("M", math.nan, "finite"),
        ("M", math.inf, "finite"),
        ("M", None, "NoneType"),
        ("M", {"a": 1}, "dict"),
        ("M", [[1], 2, 3], "list"),
        ("a.x", 1, "whole"),
        ("", 1, "--set"),
        (".", 1, "--set"),
        ("lagcli", 2, "--set"),
    ],
)
def test_a_change_of_nothing_is_refused(name: str, value: object, word: str) -> None:
    text = (
        HEAD + "parameters: {M: 1}\ncoordinates: {q: {}}\nparticles: {a: {mass: M, position: '[1, 0, 0]'}}\n"
    )
    with pytest.raises(overrides.OverrideError, match="--set") as caught:
        document.read(text, "model.yaml", {name: value})
    assert word in str(caught.value)


@pytest.mark.parametrize(
    ("name", "value", "code"),
    [
        ("M", "2 +", "syntax"),
        ("M", "1/0", "not-finite"),
        ("M", "x", "unknown-name"),
        ("M", [1, 2], "vector-length"),
        ("q.value", "t", "time-not-allowed"),
        ("a.position", "[0, 0, 0]", "not-an-initial-value"),
        ("b.position", "[q, 0, 0]", "not-an-initial-value"),
        ("b.x", "q", "not-an-initial-value"),
    ],
)
def test_a_wrong_value_is_located_in_the_change(name: str, value: object, code: str) -> None:
    text = ANGLE + "  b: {mass: M, position: [1, 0, 0]}\nparameters: {M: 1}\n"
    with pytest.raises(diagnostics.ModelError) as caught:
        document.read(text, "model.yaml", {name: value})
    (found,) = caught.value.diagnostics
    assert (found.code, found.location.path) == (code, f"--set {name}")


def test_a_change_does_not_hide_an_error_of_the_file() -> None:
    assert spots(HEAD + "coordinates: {q: [0.5]}\nlagrangian: rate(q)**2\n", q__value=1) == [
        ("not-a-mapping", 2, "[0.5]")
    ]


# Size.


def test_ten_thousand_entries_are_read_in_a_moment() -> None:
    rows = "".join(f"  c{i}: distance(a, b) = L + {i}\n" for i in range(10_000))
    text = BALL + "  b: {mass: 1, position: [2, 0, 0]}\nparameters: {L: 1}\nholonomic:\n" + rows
    with at_most_calls(10_000_000):
        assert len(read(text).holonomic) == 10_000


def test_a_flood_of_errors_ends() -> None:
    rows = "".join(f"  c{i}: a.x = b{i}\n" for i in range(20_000))
    with at_most_calls(5_000_000):
        found = errors_of(BALL + "holonomic:\n" + rows)
        assert len(found) == diagnostics.MAX_ERRORS + 1
        assert found[-1].code == "too-many-errors"


def test_a_long_expression_is_taken_and_an_endless_one_refused() -> None:
    potential = "+".join(["a.x*2"] * 100_000)
    assert len(read(BALL + f"forces: {{f: {{potential: {potential}}}}}\n").forces) == 1
    found = errors_of(BALL + "outputs: {o: " + "1+" * 5_000_000 + "1}\n")
    assert [d.code for d in found] == ["expression-too-long"]
    assert len(found[0].render()) < 1000
