"""What newcomers type, and the hint that each error gives: one that leads to a model that works."""

from __future__ import annotations

import pytest

import lagcli
from lagcli.errors import diagnostics
from tests.helpers.in_process import command

__all__ = ["command"]

BALL = """\
lagcli: 1
parameters: {L: 1, g: 9.81}
coordinates: {theta: {value: 0.5}, X: {}}
particles:
  a: {mass: 1, position: [1, 0, 0]}
  b: {mass: 1, position: [2, 0, 0]}
holonomic:
  rod: norm(a) = 1
"""
PARTICLE = "lagcli: 1\nparticles:\n  a: {mass: 1, position: [1, 0, 0]}\n"


def found(text: str) -> tuple[diagnostics.Diagnostic, ...]:
    with pytest.raises(diagnostics.ModelError) as caught:
        lagcli.loads(text)
    return caught.value.diagnostics


def test_a_force_on_nobody_is_reported_who_there_is() -> None:
    text = "lagcli: 1\nparticles: {left: {mass: 1, position: [0, 0, 0]}}\nforces: {g: {to: bob, force: [0, 0, -1]}}\n"
    (error,) = found(text)
    assert (error.code, error.hint) == ("unknown-name", "declared are `left`, `all`")


@pytest.mark.parametrize("word", ["'*'", "every", "Everything"])
def test_a_force_on_everything_is_told_the_word_for_it(word: str) -> None:
    (error,) = found(f"{PARTICLE}forces: {{g: {{to: {word}, force: [0, 0, -m]}}}}\n")
    assert (error.code, error.hint) == ("unknown-name", "write `all`")


def test_a_particle_may_have_a_name_that_is_a_word_for_everything() -> None:
    text = "lagcli: 1\nparticles: {every: {mass: 1, position: [0, 0, 0]}}\n"
    assert lagcli.loads(f"{text}forces: {{g: {{to: every, force: [0, 0, -1]}}}}\n").forces


def test_a_list_of_equations_is_told_that_each_has_a_name() -> None:
    (error,) = found(f"{PARTICLE}holonomic:\n  - a.x = 1\n")
    assert error.code == "not-a-mapping"
    assert "`rod: norm(a) = 1`" in error.hint
    assert "quotes" not in error.hint


def test_a_family_without_its_range_is_reported_how_to_give_one() -> None:
    (error,) = found("lagcli: 1\nparticles: {'p[i]': {mass: 1, position: [0, 0, 0]}}\n")
    assert error.code == "unknown-name"
    assert "`for: i = 1..N`" in error.hint


IN_EXPRESSIONS = {
    "cos(30 deg)": "`30*deg`",
    "sin(30°)": "`30*deg`",
    "cos(45 degrees)": "`45*deg`",
    "cos(30*degrees)": "`30*deg`",
    "sin(0.5 rad)": "in radians",
    "sind(30)": "`sin(x*deg)`",
    "radians(30)": "`30*deg`",
    "2 kg": "no unit",
    "9.81 m/s^2": "no unit",
    "9.81 m/s**2": "no unit",
    "3e5 Pa": "no unit",
    "5s": "no unit",
    "L mm": "no unit",
    "3 L": "`3*L`",
    "mag(b)": "`norm(u)`",
    "length(b)": "`norm(u)`",
    "magnitude(b)": "`norm(u)`",
    "ln(L)": "`log(x)`",
    "log10(L)": "`log(x)/log(10)`",
    "pow(L, 2)": "`x**y`",
    "sqr(L)": "`x**2`",
    "arctan(L)": "`atan(x)`",
    "arcsin(L)": "`asin(x)`",
    "sgn(L)": "`sign(x)`",
    "fabs(L)": "`abs(x)`",
    "sec(L)": "`1/cos(x)`",
    "heaviside(t)": "`(1 + sign(x))/2`",
    "floor(L)": "no rounding",
    "a_x": "`a.x`",
    "x_a": "`a.x`",
    "ax": "`a.x`",
    "v_a": "`a.v`",
    "b[1]": "`b.x`",
    "a[x]": "`a.x`",
    "a[0].x": "`a.x`",
    "x": "`X`",
    "y": "`a.y`",
    "a.pos": "position vector",
    "a.velocity": "`.v`",
    "a.dx": "`.v`",
    "a.mass": "`parameters`",
    "a.v.x": "`a.vx`",
    "R.a.x": "`reaction(a).x`",
    "lambda.rod": "`multiplier(NAME)`",
    "lambda(rod)": "`multiplier(NAME)`",
    "lambda_rod": "`multiplier(rod)`",
    "R_a": "`reaction(a)`",
    "e**L": "`exp(x)`",
    "PI": "`pi`",
    "π": "`pi`",
    "time": "time is `t`",
    "np.sin(t)": "without a prefix",
    "math.pi": "without a prefix",
    "sin t": "`sin(t)`",
    "sin^2(theta)": "`sin(x)**2`",
    "sin**2(theta)": "`sin(x)**2`",
    "t > 1": "no conditions",
    "t<1 ? 2 : 3": "no conditions",
    "if(t > 1, 1, 0)": "no conditions",
    "t % 1": "no remainder",
    "1,5": "`1.5`",
    "1,0,0": "`[x, y, z]`",
    "a.x₁": "no subscripts",
    "1 000": "without spaces",
    "10_000": "`10000`",
    "1.2.3": "one decimal point",
    "3 − 2": "write `-`",
    "2×3": "write `*`",
    "a·b": "`dot(u, w)`",
    "½": "`1/2`",
    "L && L": "`and`",
    "theta'": "`rate(theta)`",
    "a.x'": "`a.vx`",
    "thetadot": "`rate(theta)`",
    "theta_dot": "`rate(theta)`",
    "theta.dot": "`rate(theta)`",
    "theta.value": "`theta`",
    "dtheta/dt": "`rate(theta)`",
    "d(theta)/dt": "`rate(x)`",
    "Ẋ": "`rate(X)`",
    "thetaddot": "`rate(theta, 2)`",
    "dot(theta)": "`rate(theta)`",
    "norm(a, b)": "`distance(u, w)`",
    "distance(a)": "`norm(u)`",
    "atan(L, L)": "`atan2(y, x)`",
    "KE": "`kinetic`",
    "a.x(t)": "without parentheses",
    "[1, 2]": "third component",
    "\\theta": "backslash",
    "a.x\u200b": "invisible",
    "d theta": "`d(theta)`",
}


@pytest.mark.parametrize("expression", IN_EXPRESSIONS)
def test_a_notation_of_elsewhere_is_reported_what_to_write(expression: str) -> None:
    text = f"{BALL}outputs:\n  o: '{expression.replace(chr(39), chr(39) * 2)}'\n"
    (error,) = found(text)
    assert IN_EXPRESSIONS[expression] in error.hint, error.hint


IN_EQUATIONS = {
    "norm(a) == L": "write `=`",
    "norm(a) := L": "write `=`",
    "b.z >= -1": "have an entry under `inequality`",
    "b.z > -1": "have an entry under `inequality`",
    "norm(a) = L = 1": "an entry of its own",
    "norm(a) = 1 m": "no unit",
    "a.z = 0;": "no `;`",
}


@pytest.mark.parametrize("equation", IN_EQUATIONS)
def test_an_equation_of_elsewhere_is_reported_what_to_write(equation: str) -> None:
    (error,) = found(f"{BALL}  more: {equation}\n")
    assert IN_EQUATIONS[equation] in error.hint


IN_FILES = {
    "constraints:\n  rod: norm(a) = 1": "`holonomic`",
    "constraint: {rod: norm(a) = 1}": "`differential`",
    "nonholonomic: {k: d(a.x) = 0}": "`differential`",
    "body: {disk: [a]}": "`bodies`",
    "inertia: 2": "`bodies`",
    "gravity: [0, 0, -9.81]": "`forces`",
    "constants: {g: 9.81}": "`parameters`",
    "initial_conditions: {}": "`velocity`",
    "output: {z: a.z}": "`outputs`",
    "duration: 5": "`simulation`",
    "forces:\n  gravity: [0, 0, -m*9.81]": "{to: all, force:",
    "forces:\n  gravity: '[0, 0, -m*9.81]'": "{to: all, force: [0, 0, -m*9.81]}",
    "forces:\n  push: {on: a, force: [0, 0, 1]}": "`to`",
    "forces:\n  push: {to: a, value: [0, 0, 1]}": "`force`",
    "coordinates:\n  x: {position: 0}": "`value`",
    "coordinates:\n  x: {velocity: 0}": "`rate`",
    "simulation: {t_end: 10}": "`duration`",
    "simulation: {dt: 0.1}": "`output_step`",
    "simulation: {steps: 10}": "`samples`",
    "simulation: {tolerance: 1e-3}": "`rtol`",
    "simulation: {assemble: yes}": "`true`",
    "simulation: {duration: 5s}": "no unit",
    "simulation: {duration: 5 min}": "no unit",
    "parameters: {g: 9,81}": "decimal point",
    "parameters:\n  g: 9,81": "`9.81`",
    "parameters:\n  g: 9.81 m/s^2": "no unit",
    "parameters:\n  - g: 9.81": "`g: 9.81`",
    "parameters: {l: {value: 2}}": "after the colon",
    "holonomic:\n  - norm(a) = 1": "`rod: norm(a) = 1`",
    "outputs: a.x": "`height: a.z`",
    "units: {angle: deg}": "`30*deg`",
    "rigid: [a]": "`body: [a, b, c]`",
}


@pytest.mark.parametrize("section", IN_FILES)
def test_a_section_or_key_of_elsewhere_has_one_error_with_a_way_out(section: str) -> None:
    (error,) = found(f"{PARTICLE}{section}\n")
    assert IN_FILES[section] in error.hint


OF_PARTICLES = {
    "{mass:1, position: [1, 0, 0]}": "`mass: 1`",
    "{mass: 2 kg, position: [1, 0, 0]}": "no unit",
    "{mass: 1, position: [1, 0]}": "`a.z = 0`",
    "{mass: 1, position: [1; 0; 0]}": "commas",
    "{mass: 1, position: [0,5, 0, 0]}": "decimal point",
    "{mass: 1, position: {x: 1, y: 0, z: 0}}": "`[x, y, z]`",
    "{mass: 1, position:[1, 0, 0]}": "a space",
    "{m: 1, position: [1, 0, 0]}": "`mass`",
    "{mass: 1, pos: [1, 0, 0]}": "`position`",
    "{mass: 1, position: [1, 0, 0], v: [0, 0, 0]}": "`velocity`",
    "{mass: 1, radius: 1, position: [1, 0, 0]}": "`rigid`",
    "{mass: 1, position: [1, 0, 0], fixed: true}": "`holonomic`",
    "[1, 0, 0]": "`{mass: 1, position: [x, y, z]}`",
    "\n  mass: 1\n  position: [1, 0, 0]": "indent `mass`",
}


@pytest.mark.parametrize("entry", OF_PARTICLES)
def test_a_particle_written_otherwise_has_one_error_with_a_way_out(entry: str) -> None:
    (error,) = found(f"lagcli: 1\nparticles:\n  a: {entry}\n")
    assert OF_PARTICLES[entry] in error.hint


def test_a_list_of_particles_is_reported_the_form() -> None:
    (error,) = found("lagcli: 1\nparticles:\n  - name: a\n    mass: 1\n    position: [1, 0, 0]\n")
    assert error.message == "`particles` needs a name for each entry, with its keys after a colon"
    assert "`a: {mass: 1, position: [0, 0, 0]}`" in error.hint


def test_entries_without_indent_are_read_as_meant_so_that_further_errors_are_reported() -> None:
    errors = found("lagcli: 1\nparticles:\n  a:\n  mass: 2 kg\n  position: [1, 0, 0]\noutputs: {o: a.q}\n")
    assert [error.code for error in errors] == ["not-a-mapping", "syntax", "unknown-component"]


def test_a_coordinate_named_like_a_key_is_a_coordinate() -> None:
    text = "lagcli: 1\ncoordinates:\n  x:\n  rate: {value: 2}\nlagrangian: rate(x)**2 + rate(rate)**2\n"
    assert lagcli.loads(text).generalized_names == ("x", "rate")


def test_a_coordinate_may_be_given_by_its_value_alone() -> None:
    text = "lagcli: 1\ncoordinates:\n  X: 3\n  Y: 2*pi\nlagrangian: rate(X)**2 + rate(Y)**2\n"
    model = lagcli.loads(text)
    assert [float(coordinate.value[0]) for coordinate in model.coordinates] == pytest.approx(
        [3, 6.283185307179586]
    )
    moved = lagcli.loads(text, {"X.value": 5, "Y.rate": 1})
    assert [float(coordinate.value[0]) for coordinate in moved.coordinates] == pytest.approx(
        [5, 6.283185307179586]
    )
    assert float(moved.coordinates[1].rate[0]) == 1.0


@pytest.mark.parametrize("keep", ["[]", ""])
def test_nothing_to_keep_is_nothing_kept(keep: str) -> None:
    assert lagcli.loads(f"{PARTICLE}simulation: {{keep: {keep}}}\n").simulation.keep == ()


ANGLES = [
    ("parameters: {alpha: 30}\noutputs: {o: sin(alpha)}\n", ["alpha = 30"]),
    ("parameters: {alpha: -30}\noutputs: {o: a.x + cos(t - alpha)}\n", ["alpha = -30"]),
    ("coordinates: {theta: {value: 30}}\nlagrangian: rate(theta)**2 + cos(theta)\n", ["theta = 30"]),
    ("coordinates: {theta: 30}\nlagrangian: rate(theta)**2 + cos(theta)\n", ["theta = 30"]),
    ("outputs: {o: tan(45)}\n", ["45"]),
    ("parameters: {alpha: 30*deg}\noutputs: {o: sin(alpha)}\n", []),
    ("parameters: {alpha: 20*pi}\noutputs: {o: sin(alpha)}\n", []),
    ("parameters: {alpha: 6}\noutputs: {o: sin(alpha)}\n", []),
    ("parameters: {om: 30}\noutputs: {o: sin(om*t)}\n", []),
    ("parameters: {g: 9.81}\noutputs: {o: g*sin(t)}\n", []),
]


@pytest.mark.parametrize(("addition", "told"), ANGLES)
def test_a_number_that_looks_like_degrees_is_noted_and_fails_nothing(addition: str, told: list[str]) -> None:
    model = lagcli.loads(PARTICLE + addition)
    notes = [note for note in model.warnings if note.code == "angle-in-degrees"]
    assert [note.message.split("`")[1] for note in notes] == told
    assert all(note.severity == "note" and "*deg`" in note.hint for note in notes)


def test_a_note_is_no_warning_to_strict(tmp_path, command) -> None:
    path = tmp_path / "m.yaml"
    path.write_text(PARTICLE + "parameters: {alpha: 30}\noutputs: {o: sin(alpha)}\n", encoding="utf-8")
    _, err, code = command("check", "--strict", path)
    assert code == 0
    assert "note[angle-in-degrees]" in err
