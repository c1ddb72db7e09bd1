"""`derive`: equations of motion beside published ones, beside SymPy's own method, and beside the compiled system."""

from __future__ import annotations

import dataclasses
import json
import pathlib
import re
from xml.etree import ElementTree

import numpy as np
import pytest
import sympy
from sympy.physics import mechanics
from typer.testing import CliRunner

import lagcli
from lagcli import derivation
from lagcli.api import cache
from lagcli.cli.app import app
from lagcli.derivation.sections import derivation_page, page_sections
from lagcli.derivation.symbolic import multiplier_equations, symbolic_system, tidy
from lagcli.derivation.writing import formula as f
from lagcli.derivation.writing import markup, render_text
from lagcli.equations import system as compiled_system
from lagcli.errors import diagnostics
from lagcli.pfaffian.forms.notation import TIME

MODELS = pathlib.Path(__file__).resolve().parents[2] / "models"
# Every model of the gallery that is small enough to be evaluated here in a moment.
MODERATE = 27
# With so many rows B M^-1 B^T is compared too.
FEW_ROWS = 8
RUNNER = CliRunner()

DOUBLE = """\
lagcli: 1
parameters: {m1: 2, m2: 1, l1: 1, l2: 0.75, g: 9.81}
coordinates: {phi1: {value: 1}, phi2: {value: 0.5}}
particles:
  a: {mass: m1, position: "[l1*sin(phi1), 0, -l1*cos(phi1)]"}
  b: {mass: m2, position: "a + [l2*sin(phi2), 0, -l2*cos(phi2)]"}
forces:
  weight: {to: all, force: [0, 0, -m*g]}
"""
# One of each: forces that depend on velocity, a vector constraint, a moving one, a generalized force, a lagrangian,
# a particle that depends on time, min and abs, and a parameter for each letter that the page uses itself.
MIXED = """\
lagcli: 1
parameters: {T: 1, V: 0.5, L: 2, M: 3, t0: 0.1, lambda_x: 4, alpha: 0.25, k: 10, c: 0.5, w: [1, 2, 0.5]}
coordinates: {q: {value: 0.3, rate: 1}, s: {value: 0.1}}
particles:
  a: {mass: M, position: [1, 0, 0]}
  b: {mass: M/2, position: [1, 1, 0], velocity: [0, 0, 1]}
  d: {mass: T, position: "[L*cos(q + alpha*t), L*sin(q), s**2]"}
forces:
  drag: {to: [a, d], force: "-c*norm(v)*v + cross(w, v)"}
  spring: {potential: "k/2*(distance(a, d) - L)**2 + abs(s)"}
  motor: {to: q, force: "min(q, 1)*lambda_x*rate(q)"}
lagrangian: rate(s)**2*V/2 + rate(q)*rate(s)*cos(q)
holonomic:
  glue: b = [1, 1, 0]
  moving: distance(a, b) = 1 + alpha*t**2
differential:
  roll: d(s) - alpha*d(q) + t0*t*dt = 0
  steer: sin(q)*a.vx - a.vz + s = 0
"""


def derived(text: str, **options: object) -> derivation.Derivation:
    return lagcli.derive(lagcli.loads(text), **options)


def gallery(name: str, **options: object) -> derivation.Derivation:
    return lagcli.derive(lagcli.load(MODELS / f"{name}.yaml"), **options)


def values_of(system: symbolic_system.Symbolic) -> dict[sympy.Symbol, float]:
    """The numbers of parameters, and of the constants of rigid bodies."""
    return system.table.parameter_values | system.table.body_constants


def symbols(names: str) -> list[sympy.Symbol]:
    return [sympy.Symbol(name, real=True) for name in names.split()]


def is_zero(value: sympy.Expr) -> bool:
    return bool(sympy.simplify(value) == 0)


def require_same(page: derivation.Derivation, published: dict[str, sympy.Expr]) -> None:
    """Each published residual, by coordinate, is that of the derived equation, up to a constant factor."""
    found = dict(zip(page.system.names, page.equations(), strict=True))
    for name, residual in published.items():
        acceleration = sympy.Symbol(f"rate(rate({name}))", real=True)
        own = found[name].lhs - found[name].rhs
        factor = sympy.diff(residual, acceleration) / sympy.diff(own, acceleration)
        assert is_zero(own * factor - residual), name


def test_pendulum_in_its_angle() -> None:
    """Landau and Lifshitz, Mechanics, par. 11: theta'' + (g/L) sin theta = 0."""
    g, L, theta, a = symbols("g L theta rate(rate(theta))")
    require_same(gallery("pendulum-angle"), {"theta": a + g / L * sympy.sin(theta)})


def test_pendulum_with_its_tension() -> None:
    """Goldstein, ch. 1, D.23: m r'' = -m g e_z - tension r/|r|, tension = m (v^2 + g L cos theta)/L on the circle."""
    page = gallery("pendulum", solve=True)
    m, g, L, x, y, z, tension, plane = symbols("m g L a.x a.y a.z lambda.rod lambda.plane")
    r = sympy.sqrt(x**2 + y**2 + z**2)
    ax, ay, az = symbols("rate(rate(a.x)) rate(rate(a.y)) rate(rate(a.z))")
    published = {
        "a.x": m * ax + tension * x / r,
        "a.y": m * ay + tension * y / r - plane,
        "a.z": m * az + m * g + tension * z / r,
    }
    require_same(page, published)
    solved = _solved(page)
    vx, vy, vz = symbols("rate(a.x) rate(a.y) rate(a.z)")
    swing = {y: 0, vy: 0}
    own = page.system.table.calculus.expanded(solved.values[0]).xreplace(swing)
    assert is_zero(own - m * (vx**2 + vz**2 - g * z) / L)
    assert solved.values[1] == 0


def _solved(page: derivation.Derivation) -> multiplier_equations.ClosedForm:
    inverted = multiplier_equations.inverse(page.system)
    assert inverted.entries is not None
    return multiplier_equations.solve(
        page.system, multiplier_equations.equation(page.system, inverted.entries)
    )


def test_double_pendulum_in_its_angles() -> None:
    """The equations of the Lagrangian in Landau and Lifshitz, Mechanics, par. 5, problem 1, as printed widely."""
    m1, m2, l1, l2, g, p1, p2, v1, v2, a1, a2 = symbols(
        "m1 m2 l1 l2 g phi1 phi2 rate(phi1) rate(phi2) rate(rate(phi1)) rate(rate(phi2))"
    )
    sin, cos = sympy.sin, sympy.cos
    published = {
        "phi1": (m1 + m2) * l1 * a1
        + m2 * l2 * a2 * cos(p1 - p2)
        + m2 * l2 * v2**2 * sin(p1 - p2)
        + (m1 + m2) * g * sin(p1),
        "phi2": l2 * a2 + l1 * a1 * cos(p1 - p2) - l1 * v1**2 * sin(p1 - p2) + g * sin(p2),
    }
    require_same(derived(DOUBLE), published)


def test_double_pendulum_with_both_tensions() -> None:
    """At rest: T1 = m1 g cos t1/(1 - m2 cos(D)^2/(m1 + m2)), T2 = T1 m2 cos(D)/(m1 + m2), D = t1 - t2."""
    page = gallery("double-pendulum")
    solved = _solved(page)
    m1, m2, L1, L2, g, t1, t2 = symbols("m1 m2 L1 L2 g theta1 theta2")
    sin, cos = sympy.sin, sympy.cos
    place = {
        "a.x": L1 * sin(t1),
        "a.y": 0,
        "a.z": -L1 * cos(t1),
        "b.x": L1 * sin(t1) + L2 * sin(t2),
        "b.y": 0,
        "b.z": -L1 * cos(t1) - L2 * cos(t2),
    }
    at = {sympy.Symbol(n, real=True): value for n, value in place.items()}
    at |= {sympy.Symbol(f"rate({n})", real=True): 0 for n in place}
    expanded = page.system.table.calculus.expanded
    upper = m1 * g * cos(t1) / (1 - m2 * cos(t1 - t2) ** 2 / (m1 + m2))
    assert is_zero(expanded(solved.values[0]).subs(at) - upper)
    assert is_zero(expanded(solved.values[1]).subs(at) - upper * m2 * cos(t1 - t2) / (m1 + m2))


def test_rolling_disk() -> None:
    """Bloch, Nonholonomic Mechanics and Control, 1.4, in the signs of the model."""
    M, a, roll, turn, theta = symbols("M a I_roll I_turn theta")
    one, two = symbols("lambda.roll_x lambda.roll_y")
    ax, ay, at, ap = symbols("rate(rate(x)) rate(rate(y)) rate(rate(theta)) rate(rate(phi))")
    page = gallery("rolling-disk", solve=True)
    published = {
        "x": M * ax - one,
        "y": M * ay - two,
        "theta": turn * at,
        "phi": roll * ap + a * one * sympy.sin(theta) - a * two * sympy.cos(theta),
    }
    require_same(page, published)
    # The force of the plane has the constant size M a theta' phi'.
    w, u = symbols("rate(theta) rate(phi)")
    values = _solved(page).values
    assert is_zero(values[0] ** 2 + values[1] ** 2 - (M * a * w * u) ** 2)


def test_knife_edge() -> None:
    """Bloch, Nonholonomic Mechanics and Control, 1.6."""
    m, J, g, alpha, phi, lam = symbols("m J g alpha phi lambda.edge")
    ax, ay, ap = symbols("rate(rate(x)) rate(rate(y)) rate(rate(phi))")
    published = {
        "x": m * ax - lam * sympy.sin(phi) - m * g * sympy.sin(alpha),
        "y": m * ay + lam * sympy.cos(phi),
        "phi": J * ap,
    }
    require_same(gallery("knife-edge"), published)


def test_bead_on_a_rotating_hoop() -> None:
    """Goldstein, ch. 2, exercise 18: theta'' = Omega^2 sin theta cos theta - (g/rho) sin theta."""
    g, rho, W, theta, a = symbols("g rho Omega theta rate(rate(theta))")
    sin, cos = sympy.sin, sympy.cos
    residual = a - W**2 * sin(theta) * cos(theta) + g / rho * sin(theta)
    page = gallery("bead-on-rotating-hoop")
    require_same(page, {"theta": residual})
    assert "T = ½ m ρ² θ̇² + ½ m ρ² Ω² sin² θ" in page.text()


@pytest.mark.parametrize(
    "name", ["pendulum-angle", "rolling-disk", "knife-edge", "bead-on-rotating-hoop", "double"]
)
def test_sympys_own_method_gives_the_same(name: str) -> None:
    """`LagrangesMethod` of L = T - V + the `lagrangian` and the rows, with multipliers of the other sign."""
    page = derived(DOUBLE) if name == "double" else gallery(name)
    system = page.system
    time = mechanics.dynamicsymbols._t
    q = [mechanics.dynamicsymbols(f"q{i}") for i in range(len(system.q))]
    moving = dict(zip((*system.q, *system.v, TIME), (*q, *(x.diff(time) for x in q), time), strict=True))
    L = (system.general + system.extra - sympy.Add(*system.potentials)).subs(moving)
    rows = [sum(b * system.v[i] for i, b in row.B.items()).subs(moving) for row in system.rows]
    method = mechanics.LagrangesMethod(L, q, nonhol_coneqs=rows or None)
    theirs = method.form_lagranges_equations()
    back = dict(zip((x.diff(time, 2) for x in q), system.a, strict=True))
    still = {x.diff(time): v for x, v in zip(q, system.v, strict=True)}
    plain = dict(zip((*q, time), (*system.q, TIME), strict=True))
    lam = {mechanics.dynamicsymbols(f"lam{i}"): -own for i, own in enumerate(system.lam, 1)}
    for own, other in zip(page.equations(), theirs, strict=True):
        other = other.doit().subs(lam).subs(back).subs(still).subs(plain)
        assert is_zero(own.lhs - own.rhs - other)


def _values(page: derivation.Derivation, expressions: list[sympy.Expr], at: dict) -> np.ndarray:
    known = list(at)
    plain = [page.system.table.calculus.expanded(sympy.sympify(e)) for e in expressions]
    return np.array(sympy.lambdify(known, plain, "numpy", cse=True)(*at.values()), dtype=float)


def _sizes() -> list[str]:
    found = []
    for path in sorted(MODELS.glob("*.yaml")):
        if len(lagcli.load(path).coordinate_names) <= MODERATE:
            found.append(path.stem)
    assert len(found) > 30
    return found


@pytest.mark.parametrize("name", [*_sizes(), "mixed"])
def test_derived_equations_have_the_numbers_of_the_compiled_system(name: str) -> None:
    """M, h, f, B, b, gamma and B M^-1 B^T, gamma - B M^-1 h at a random state off the constraints."""
    model = lagcli.loads(MIXED) if name == "mixed" else lagcli.load(MODELS / f"{name}.yaml")
    ready = cache.compiled(model)
    system = symbolic_system.symbolic(model, ready.system.bodies)
    page = derivation.Derivation("", "", (), system)
    random, n = np.random.default_rng(7), len(system.q)
    q, v = (start + 0.1 * random.normal(size=n) for start in compiled_system.start(model))
    p, t = compiled_system.parameter_values(model, ready.system.bodies), 0.3
    at = dict(zip((TIME, *system.q, *system.v), (t, *q, *v), strict=True)) | values_of(system)
    numeric = ready.numeric
    M, (h, gamma, _) = numeric.inertia(t, q, v, p), numeric.force(t, q, v, p)
    B, b = numeric.rows(t, q, v, p)
    M, h, gamma, B, b = (np.array(part) for part in (M, h, gamma, B, b))

    def require(own: np.ndarray, other: np.ndarray) -> None:
        other = np.ravel(other)
        assert np.abs(np.ravel(own) - other).max(initial=0) <= 1e-11 * (1 + np.abs(other).max(initial=0))

    places = [(i, j) for i in range(n) for j in range(n)]
    require(_values(page, [system.matrix(i, j) for i, j in places], at), M)
    require(_values(page, list(system.h), at), h)
    require(
        _values(page, [row.f for row in system.rows if row.f is not None], at),
        np.array(numeric.holonomic(t, q, p)[0]),
    )
    require(_values(page, [row.B.get(i, 0) for row in system.rows for i in range(n)], at), B)
    require(_values(page, [row.b for row in system.rows], at), b)
    require(_values(page, [row.gamma for row in system.rows], at), gamma)
    inverted = multiplier_equations.inverse(system)
    if 0 < len(system.rows) <= FEW_ROWS and inverted.entries is not None:
        equation = multiplier_equations.equation(system, inverted.entries)
        pairs = [(i, j) for i in range(len(B)) for j in range(len(B))]
        require(_values(page, [equation.S.get(pair, 0) for pair in pairs], at), B @ np.linalg.solve(M, B.T))
        require(_values(page, list(equation.right), at), gamma - B @ np.linalg.solve(M, h))


@pytest.mark.parametrize(
    "name", ["pendulum", "rolling-disk", "knife-edge", "spherical-pendulum", "conical-pendulum"]
)
def test_closed_forms_have_the_numbers_of_a_run(name: str) -> None:
    model = lagcli.load(MODELS / f"{name}.yaml")
    page = lagcli.derive(model, solve=True)
    run = lagcli.simulate(model, duration=0.4, samples=3)
    values = _solved(page).values
    assert len(values) == len(page.system.rows)
    at = {TIME: run.t[-1]} | values_of(page.system)
    for q, v, name_ in zip(page.system.q, page.system.v, page.system.names, strict=True):
        particle, _, axis = name_.rpartition(".")
        at |= {q: run[name_][-1], v: run[f"{particle}.v{axis}" if particle else f"rate({name_})"][-1]}
    for r, value in values.items():
        expected = run[f"lambda.{page.system.rows[r].name}"][-1]
        assert _values(page, [value], at)[0] == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_the_identity_is_proved_for_what_is_right_and_fails_for_what_is_wrong() -> None:
    page = derived(DOUBLE)
    assert list(page_sections.identity(page.system)) == [(0, True, "identically"), (1, True, "identically")]
    wrong = dataclasses.replace(page.system, general=page.system.general * sympy.Rational(1001, 1000))
    assert [holds for _, holds, _ in page_sections.identity(wrong)] == [False, False]
    assert "D.31" in page.text()


def test_a_page_reads_like_a_textbook() -> None:
    text = gallery("pendulum", solve=True).text()
    for line in (
        "f_rod = L − d_a = 0",
        "d_a = |r_a|",
        "B_rod,a = −r_a/d_a",
        "R_a = −λ_rod r_a/d_a + λ_plane e_y",
        "m r̈_a = −m g e_z − λ_rod r_a/d_a + λ_plane e_y",
        "γ_rod = |ṙ_a|²/d_a − (r_a·ṙ_a)²/d_a³",
        "λ_rod = m (|ṙ_a|² − g z_a)/L",
    ):
        assert any(row.strip() == line or row.strip().startswith(line + " ") for row in text.split("\n")), (
            line
        )
    assert "1.0" not in text
    assert "*" not in text


def test_all_lines_have_numbers_of_the_text() -> None:
    lines = [line for name in ("double-pendulum", "rolling-disk") for line in gallery(name).as_json()]
    numbers = {line["equation"] for line in lines}
    assert {"D.2", "D.3", "D.6", "D.7", "D.22", "D.23", "D.24", "D.53"} <= numbers
    assert all(line["equation"] for line in lines if line["left"] and line["left"][0] in "BRQfγλ")
    assert all(line.keys() == {"section", "equation", "left", "right", "latex", "note"} for line in lines)


def test_letters_that_the_model_takes_are_left_to_it() -> None:
    page = derived(MIXED)
    shown = [line["left"] for line in page.as_json()]
    assert {"𝒯", "𝒱", "ℒ"} <= set(shown)
    assert len({*shown} - {""}) == len([x for x in shown if x])  # no two lines define one sign


def test_strange_names_are_safe_in_every_format() -> None:
    page = derived(
        "lagcli: 1\nparameters: {_: 2, a__b_: 3, x_a: 1, theta_: 5, Lambda12_3: 1}\n"
        "coordinates: {theta: {}, __q: {value: 1}}\n"
        "particles:\n  a: {mass: _, position: [1, 0, 0]}\n"
        "lagrangian: a__b_*rate(theta)**2 + theta_*rate(__q)**2*x_a\n"
        "holonomic: {r_1: a.x = x_a, r_2: Lambda12_3*theta = __q - 1}\n",
        solve=True,
    )
    latex = page.latex()
    plain = re.sub(r"\\[_{}]", "", latex)
    assert plain.count("{") == plain.count("}")
    in_names = re.findall(r"\\mathrm\{([^{}]*)\}", latex)
    assert in_names
    assert not any(re.search(r"(?<!\\)[_^#$%&]", name) for name in in_names)
    # x_a is a parameter here: the x of particle a has another sign.
    assert "f_r_1 = a.x − x_a" in page.text()
    ElementTree.fromstring(_markup(page.html()))


def _markup(page: str) -> str:
    """The body of a page as XML."""
    body = page[page.index("<body>") : page.index("</body>") + 7]
    return body.replace("<br>", "<br/>")


@pytest.mark.parametrize("name", ["moving-ramp-stick", "rigid-plate", "bead-on-rotating-hoop"])
def test_html_is_well_formed_and_needs_no_network(name: str) -> None:
    page = gallery(name, solve=True).html()
    body = ElementTree.fromstring(_markup(page))
    assert len(list(body.iter("math"))) > 5
    assert all(len(list(fraction)) == 2 for fraction in body.iter("mfrac"))
    assert "http" not in page
    assert "<script" not in page
    assert "src=" not in page


@pytest.mark.parametrize("name", ["moving-ramp-stick", "rigid-plate", "car-with-trailer"])
def test_latex_has_one_mark_of_alignment_in_a_row(name: str) -> None:
    latex = gallery(name).latex()
    splits = re.findall(r"\\begin\{split\}\n(.*?)\n\\end\{split\}", latex, re.DOTALL)
    assert splits
    assert all(row.count("&") == 1 for split in splits for row in split.split("\\\\"))
    assert latex.count(r"\left") == latex.count(r"\right")
    assert latex.count(r"\begin{equation*}") == latex.count(r"\end{equation*}")


def test_markdown_tags_each_equation() -> None:
    text = gallery("knife-edge").markdown()
    assert r"\tag{D.53}" in text
    assert text.count("$$") % 2 == 0


def test_families_are_cut_and_all_shows_everything() -> None:
    text = """\
lagcli: 1
parameters: {N: 12, m: 1, L: 0.1}
particles:
  p[i]: {for: "i = 1..N", mass: m, position: "[i*L, 0, 0]"}
holonomic:
  link[i]: {for: "i = 2..N", equation: "L = distance(p[i-1], p[i])"}
"""
    short, whole = derived(text), derived(text, everything=True)
    assert "… 8 lines like these left out; --all shows them" in short.text()
    assert "left out" not in whole.text()
    assert [line["left"] for line in whole.as_json() if line["left"].startswith("f_")] == [
        f"f_link{i}" for i in range(2, 13)
    ]
    assert short.equations() == whole.equations()


def test_values_are_put_in_only_where_asked() -> None:
    assert "9.81" not in gallery("pendulum").text()
    text = gallery("pendulum", values=["g", "theta0"]).text()
    assert "V = 9.81 m z_a" in text
    assert "theta0 = π/3" in text
    # A component of a vector that is zero is left out, and that is said.
    assert "pivot = (0, 0, 0)" in text
    with pytest.raises(ValueError, match="no parameter `gg`"):
        gallery("pendulum", values=["gg"])


def test_no_closed_form_is_explained() -> None:
    assert "up to 4" in gallery("rigid-plate", solve=True).text()
    assert "are not independent" in gallery("twin-rod", solve=True).text()
    assert "no constraint row" in gallery("pendulum-angle", solve=True).text()


def test_what_is_too_large_is_refused() -> None:
    long = " + ".join(f"x**{n % 7 + 1}*{n}" for n in range(2500))
    model = lagcli.loads(f"lagcli: 1\ncoordinates: {{x: {{}}}}\nlagrangian: rate(x)**2 + {long}\n")
    with pytest.raises(diagnostics.ModelError) as error:
        lagcli.derive(model)
    assert [found.code for found in error.value.diagnostics] == ["too-large-to-derive"]


def test_what_is_nested_too_deeply_is_refused() -> None:
    names = [f"  x{i}: sin(x{i - 1})\n" for i in range(1, 600)]
    text = "lagcli: 1\ncoordinates: {x0: {}}\ndefinitions:\n" + "".join(names)
    model = lagcli.loads(text + "lagrangian: rate(x0)**2 - x599\n")
    with pytest.raises(diagnostics.ModelError) as error:
        lagcli.derive(model)
    assert [found.code for found in error.value.diagnostics] == ["too-large-to-derive"]


def test_numbers_are_written_as_in_print() -> None:
    text = derived(
        "lagcli: 1\nparticles: {a: {mass: 5.97e24, position: [1, 0, 0]}}\n"
        "forces: {pull: {to: a, force: -6.674e-11*m*r*0.1/3}}\n"
    ).text()
    assert "T = 2.985·10²⁴ |ṙ_a|²" in text
    assert "5.97·10²⁴ r̈_a = −1.328126·10¹³ r_a" in text


def test_command(tmp_path: pathlib.Path) -> None:
    path = str(MODELS / "knife-edge.yaml")
    result = RUNNER.invoke(app, ["derive", path, "--solve"])
    assert result.exit_code == 0
    assert result.stdout.startswith("Knife edge on an inclined plane\n")
    assert result.stdout == gallery("knife-edge", solve=True).text() + "\n"
    lines = json.loads(RUNNER.invoke(app, ["derive", path, "--json"]).stdout)
    assert lines == gallery("knife-edge").as_json()
    assert RUNNER.invoke(app, ["derive", path, "--format", "latex"]).stdout.startswith("\\documentclass")
    for wrong in (["--format", "pdf"], ["--values", "nothing"], ["--set", "nothing=1"]):
        assert RUNNER.invoke(app, ["derive", path, *wrong]).exit_code == 2
    broken = tmp_path / "broken.yaml"
    broken.write_text("lagcli: 1\ncoordinates: {x: {}}\nlagrangian: rate(y)**2\n")
    result = RUNNER.invoke(app, ["derive", str(broken), "--format", "json"])
    assert result.exit_code == 1
    assert json.loads(result.stdout)["errors"][0]["code"] == "unknown-name"


def test_the_example_of_the_documentation_is_what_is_printed() -> None:
    page = (MODELS.parent / "docs" / "explanation" / "derivation.md").read_text(encoding="utf-8")
    shown = page.partition("```text\n")[2].partition("```")[0].split("\n")
    printed = gallery("rolling-disk", solve=True).text().split("\n")
    assert len(shown) > 20
    assert [line for line in printed if line in shown and line] == [line for line in shown if line]


# Hostile and very large models.


@pytest.mark.parametrize("form", ["text", "latex", "markdown", "html"])
def test_no_title_steers_a_terminal_or_breaks_a_page(form):
    title = "\\e]0;pwned\\a\\e[2J\\u009b31m \\u202e \\r \\0 over\\n\\ntwo lines"
    page = lagcli.derive(
        lagcli.loads(f'lagcli: 1\ntitle: "{title}"\nparticles: {{a: {{mass: 1, position: [0, 0, 0]}}}}')
    )
    written = getattr(page, form)()
    assert all(letter.isprintable() or letter == "\n" for letter in written)
    assert "over two lines" in written
    assert "\n" not in page.title


def test_a_document_in_latex_tells_it_every_letter():
    title = "\u05e9\u05dc\u05d5\u05dd \u0416 \U0001f600 \u202e \u4e2d"
    page = lagcli.derive(
        lagcli.loads(f'lagcli: 1\ntitle: "{title}"\nparticles: {{a: {{mass: 1, position: [0, 0, 0]}}}}')
    )
    head, _, body = page.latex().partition("\\begin{document}")
    beyond = {letter for letter in body if letter > "\u017f"}
    assert {ord(letter) for letter in beyond} == {int(code, 16) for code in re.findall(r"ter\{(\w+)\}", head)}
    assert len(beyond) == 8
    assert "Declare" not in gallery("pendulum").latex()


def nested(depth, inner="a.x"):
    rows = "sin(" * depth + inner + ")" * depth
    return lagcli.loads(
        f"lagcli: 1\nparticles: {{a: {{mass: 1, position: [0, 0, 0]}}}}\nholonomic: {{c: {rows} = 0}}"
    )


def test_a_long_side_goes_on_with_its_sign_in_html():
    line = derivation_page.Line(sides=(f.FormulaSum(tuple((1, f.Sign("a" * 40)) for _ in range(4))), f.ZERO))
    assert line.html().count("<mo>+</mo>") == 3
    assert line.latex().count(" + ") == 3


@pytest.mark.parametrize("writer", ["text", "latex", "mathml"])
@pytest.mark.parametrize("kind", ["function", "fraction", "power", "sum"])
def test_each_part_of_a_formula_is_written_once(writer, kind, monkeypatch):
    depth, node = 12, f.Sign("x")
    for _ in range(depth):
        match kind:
            case "function":
                node = f.Apply("sin", (node,))
            case "fraction":
                node = f.Fraction(f.ONE, node)
            case "power":
                node = f.FormulaPower(node, f.FormulaNumber("3"))
            case _:
                node = f.FormulaSum(((1, node), (-1, f.ONE)))
    written, module = [], render_text if writer == "text" else markup
    writers = module._WRITERS
    for each, write in dict(writers).items():
        monkeypatch.setitem(writers, each, lambda *given, write=write: written.append(1) or write(*given))
    getattr(module, writer)(node)
    # Parts at most twice, and not twice for each level: two parts a level, and the innermost one.
    assert len(written) <= 2 * (2 * depth + 1)


def test_deeply_nested_functions_are_written_out():
    depth = 16
    page = lagcli.derive(nested(depth))
    assert "sin(" * (depth - 1) in page.text()
    x = page.system.q[0]
    assert str(page.constraints()[0].lhs).count("sin(") == depth
    assert page.constraints()[0].lhs.free_symbols == {x}


def test_what_takes_too_long_to_be_derived_is_refused():
    with pytest.raises(
        lagcli.ModelError, match=r"cannot be written out: it takes longer than 0\.05 s"
    ) as caught:
        lagcli.derive(nested(30), limit=0.05)
    (found,) = caught.value.diagnostics
    assert found.code == "too-large-to-derive"
    assert "--limit" in found.hint
    with pytest.raises(ValueError, match="limit"):
        lagcli.derive(nested(2), limit=float("nan"))


WEDGE = """
lagcli: 1
parameters: {M: 3, m: 1, a: 0.2, alpha: 0.5, g: 9.81}
coordinates: {X: {}, s: {}, phi: {}}
lagrangian: >-
  M/2*rate(X)**2 + m/2*(rate(X)**2 + rate(s)**2 + 2*rate(X)*rate(s)*cos(alpha))
  + m*a**2*rate(phi)**2/2 + m*g*s*sin(alpha)
differential: {roll: rate(s) = a*rate(phi)}
"""
HELIX = """
lagcli: 1
parameters: {m: 0.1, r: 0.5, h: 0.2, g: 9.81}
particles: {bead: {mass: m, position: [r, 0, 0]}}
forces: {gravity: {to: bead, force: [0, 0, -m*g]}}
holonomic: {fx: bead.x = r*cos(bead.z/h), fy: bead.y = r*sin(bead.z/h)}
"""


def solved(text, values=()):
    page = lagcli.derive(lagcli.loads(text), solve=True, values=values)
    return [line for line in page.as_json() if line["section"] == "Solution"]


def right(lines, left):
    (line,) = (line for line in lines if line["left"] == left)
    return line["right"]


def test_common_factors_are_cancelled_as_in_the_textbook():
    """A hoop that rolls down a wedge which slides: below stands 2 M + m + m sin^2 alpha, and nothing else."""
    lines = solved(WEDGE)
    below = "2 M + m + m sin² α"
    assert right(lines, "Ẍ") == f"−m g sin α cos α/({below})"
    assert right(lines, "s̈") == f"(M + m) g sin α/({below})"
    assert right(lines, "φ̈") == f"(M + m) g sin α/(({below}) a)"
    assert right(lines, "λ_roll") == f"−(M + m) m g sin α/({below})"


def test_the_free_coordinate_of_a_helix_has_its_equation():
    lines = solved(HELIX)
    assert right(lines, "z̈_bead") == "−g h²/(r² + h²)"
    x = "m g r h sin(z_bead/h)/(r² + h²) − m r ż_bead² cos(z_bead/h)/h²"
    assert right(lines, "λ_fx") == x


def test_accelerations_without_rows_are_those_of_the_equations():
    model = lagcli.loads(DOUBLE)
    lines = solved(DOUBLE)
    assert [line["left"] for line in lines if line["left"]] == ["φ̈₁", "φ̈₂"]
    page = lagcli.derive(model, solve=True)
    system = page.system
    found = sympy.solve([equation.lhs - equation.rhs for equation in page.equations()], system.a)
    place = {**dict(zip(system.q, (1.0, 0.5), strict=True)), **dict(zip(system.v, (0.3, -0.2), strict=True))}
    place |= {
        symbol: value
        for symbol in found[system.a[0]].free_symbols
        for value in [PLAIN.get(str(symbol))]
        if value
    }
    run = lagcli.simulate(
        lagcli.loads(
            DOUBLE.replace("value: 1}", "value: 1, rate: 0.3}").replace("0.5}", "0.5, rate: -0.2}") + OUT
        ),
        duration=0.01,
        samples=2,
    )
    for a, column in zip(system.a, ("a1", "a2"), strict=True):
        np.testing.assert_allclose(float(found[a].subs(place)), run[column][0], rtol=1e-12)


PLAIN = {"m1": 2, "m2": 1, "l1": 1, "l2": 0.75, "g": 9.81}
OUT = "outputs: {a1: 'rate(phi1, 2)', a2: 'rate(phi2, 2)'}\n"


@pytest.mark.parametrize("name", ["pendulum", "double-pendulum-angles", "rolling-disk", "zeno-ball", "co2"])
def test_a_fragment_is_aligned_equations_and_notes(name):
    fragment = gallery(name).latex(fragment=True)
    blocks = re.findall(r"\\begin\{align\*\}\n(.*?)\n\\end\{align\*\}", fragment, re.DOTALL)
    assert len(blocks) == fragment.count(r"\begin{") == fragment.count(r"\end{") > 3
    for block in blocks:
        for row in block.split(" \\\\\n"):
            assert row.count("&") == 1, row
            assert row.count(r"\tag") <= 1
        assert not block.endswith("\\")
        assert "\n\n" not in block
    assert r"\section" not in fragment
    assert fragment.splitlines()[1].startswith(r"% \usepackage{amsmath}")
    numbers = re.findall(r"\\tag\{(.*?)\}", gallery(name).latex())
    assert re.findall(r"\\tag\{(.*?)\}", fragment) == numbers


def test_rates_in_words_are_letters_with_dots():
    titles = re.findall(r"subsection\*.*", gallery("pendulum").latex())
    assert any(r"$\ddot{q}$" in title for title in titles)
    assert not any("\u0308" in title or "\u0307" in title for title in titles)


@pytest.mark.parametrize(
    "text",
    [
        "(a + b)**3*(a - c)",
        "a*sqrt(b + c)*(a + sqrt(b + a*(b + c)))",
        "(a + b)**-2*(a + c)",
        "sin(a*(b + c))*(a + b)",
    ],
)
def test_the_size_of_an_expanded_form_is_bounded_before_it_is_made(text):
    """No form has more terms than were counted, and what would fill pages is left as it is."""
    value = sympy.sympify(text)
    terms, parts = tidy._expanded(value)
    wide = sympy.expand(value)
    assert len(sympy.Add.make_args(wide)) <= terms
    assert terms * parts <= tidy.MOST_PARTS
    large = sympy.sympify(
        "acos((a + b + c + d)*(e + f + g + h)*(i + j + k + l))*(a + b)*(i + k)*(a + e)**4*(c + g)**4"
    )
    assert tidy.tidy(large) == sympy.factor_terms(large)
    assert np.prod(tidy._expanded(large)) > tidy.MOST_PARTS
