"""Refusals: what a model may not say, each with its code, its place, the reason and what to do about it."""

from __future__ import annotations

import dataclasses
import json
import sys
from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli import __main__ as entry
from lagcli.api import run_settings
from lagcli.equations import system as mechanics
from lagcli.errors import catalogue
from lagcli.model import settings
from lagcli.output.files import interrupts

BALL = "lagcli: 1\nparticles:\n  a: {mass: 1, position: [1, 0, 0]}\n  b: {mass: 2, position: [2, 0, 0]}\n"
KNIFE = """\
lagcli: 1
coordinates:
  x: {value: 0, rate: 1}
  y: {value: 0, rate: 0}
particles:
  a: {mass: 1, position: [1, 0, 0]}
lagrangian: (rate(x)**2 + rate(y)**2)/2
"""
CHAIN = """\
lagcli: 1
parameters: {N: 3}
particles:
  p[i]: {for: "i = 1..N", mass: 1, position: "[i, 0, 0]"}
holonomic:
  link[i]: {for: "i = 2..N", equation: "distance(p[i], p[i-1]) = 1"}
"""


@dataclasses.dataclass(frozen=True, slots=True)
class Refusal:
    """A model, the command, and what it is refused with; `at` is the text the carets stand under."""

    text: str
    code: str
    at: str
    reason: str
    hint: str
    command: str = "check"
    exit: int = 1


def law(equation: str, definitions: str = "") -> str:
    """A model with one differential law."""
    return f'{KNIFE}{definitions}differential:\n  law: "{equation}"\n'


def nonlinear(equation: str, at: str, reason: str, hint: str = "Chetaev's rule is not computed") -> Refusal:
    return Refusal(law(equation), "nonlinear-differential", at, f"`{at}` {reason}", hint)


def force(vector: str) -> str:
    """A model with a rod and one force."""
    return f'{BALL}holonomic:\n  rod: distance(a, b) = 1\nforces:\n  f: {{to: a, force: "{vector}"}}\n'


def lagrangian(text: str, x: str = "value: 1", y: str = "value: 0, rate: 1", more: str = "") -> str:
    """A model of two coordinates."""
    return f"lagcli: 1\ncoordinates:\n  x: {{{x}}}\n  y: {{{y}}}\nlagrangian: {text}\n{more}"


def row(equation: str, velocity: str = "[0, 0, 0]") -> str:
    """A particle with one holonomic row."""
    return (
        f"lagcli: 1\nparticles:\n  a: {{mass: 1, position: [1, 0, 0], velocity: {velocity}}}\n"
        f'holonomic:\n  h: "{equation}"\nsimulation: {{duration: 1, samples: 3}}\n'
    )


QUADRATIC, PLAIN = "is quadratic in the velocities", "is not linear in the velocities"
NONLINEAR = [
    nonlinear("rate(x)**2 + rate(y)**2 = 1", "rate(x)**2", QUADRATIC),
    nonlinear("x*rate(x) + d(t)*0 + rate(y)**3 = 1", "rate(y)**3", "is cubic in the velocities"),
    nonlinear("d(x)*d(y) = 0", "d(x)*d(y)", "is quadratic in the differentials"),
    nonlinear("d(x) = dt*dt", "dt*dt", "is quadratic in the differentials"),
    nonlinear("sqrt(rate(x)**2 + rate(y)**2) = 1", "rate(x)**2", QUADRATIC),
    nonlinear("norm(a.v) = 2", "norm(a.v)", PLAIN),
    nonlinear("rate(x)*rate(x) = 1", "rate(x)*rate(x)", QUADRATIC),
    nonlinear("-rate(x)**2 = -1", "rate(x)**2", QUADRATIC),
    nonlinear("rate(x)*(-rate(x)) = 1", "rate(x)*(-rate(x))", QUADRATIC),
    nonlinear("x*(y + rate(x)*(1 + rate(y))) = 1", "rate(x)*(1 + rate(y))", QUADRATIC),
    nonlinear("norm(rate(a)) = 1", "norm(rate(a))", PLAIN),
    nonlinear("norm([rate(x), rate(y), 0]) = 1", "norm([rate(x), rate(y), 0])", PLAIN),
    nonlinear("sqrt(rate(x)**2) = 1", "rate(x)**2", QUADRATIC),
    nonlinear("(x*rate(x))**2 = 1", "(x*rate(x))**2", QUADRATIC),
    nonlinear("rate(x)**0.5 = 1", "rate(x)**0.5", PLAIN),
    nonlinear("rate(x)**(-1) = 1", "rate(x)**(-1)", PLAIN),
    nonlinear("rate(x)**rate(y) = 1", "rate(x)**rate(y)", PLAIN),
    nonlinear("2**rate(x) = 2", "2**rate(x)", PLAIN),
    nonlinear("rate(x)**y = 2", "rate(x)**y", PLAIN),
    nonlinear(
        "cross(a.v, a.v + [rate(x), 0, 0]) = [0, 0, 0]", "cross(a.v, a.v + [rate(x), 0, 0])", QUADRATIC
    ),
    nonlinear("atan2(rate(x), rate(y)) = 1", "atan2(rate(x), rate(y))", PLAIN),
    nonlinear("sign(rate(x)) = 1", "sign(rate(x))", PLAIN),
    nonlinear("d(x)**2 + d(y)**2 = dt**2", "d(x)**2", "is quadratic in the differentials"),
    nonlinear("abs(d(x)) = dt", "abs(d(x))", "is not linear in the differentials"),
    nonlinear("d(x)*dt = 0", "d(x)*dt", "is quadratic in the differentials"),
    nonlinear("distance(a.v, [1, 0, 0]) = 2", "distance(a.v, [1, 0, 0])", PLAIN),
    nonlinear("dot(a.v, a.v) = 2", "dot(a.v, a.v)", QUADRATIC),
    nonlinear("rate(x)*a.vy = 0", "rate(x)*a.vy", QUADRATIC),
    nonlinear("abs(rate(x)) = 1", "abs(rate(x))", PLAIN),
    nonlinear("max(rate(x), 0) = 1", "max(rate(x), 0)", PLAIN),
    nonlinear("sin(rate(x)) = 0", "sin(rate(x))", PLAIN),
    nonlinear("sin(d(x)) = 0", "sin(d(x))", "is not linear in the differentials"),
    nonlinear("a.v = [1, rate(x)**2, 0]", "rate(x)**2", QUADRATIC),
    nonlinear("rate(x)/rate(y) = 1", "rate(x)/rate(y)", PLAIN, "multiply the law by the denominator"),
    nonlinear(
        "d(x)/dt = 1", "d(x)/dt", "is not linear in the differentials", "divided by `dt` is written `rate(x)`"
    ),
    nonlinear(
        "d(x)/d(y) = 1",
        "d(x)/d(y)",
        "is not linear in the differentials",
        "multiply the law by the denominator",
    ),
    nonlinear("1/rate(x) = 1", "1/rate(x)", PLAIN, "multiply the law by the denominator"),
    nonlinear("d(x)*rate(y) = 0", "d(x)*rate(y)", "mixes differentials and velocities", "do not mix"),
    # Linear once terms have cancelled: refused, with the term, and never computed wrongly.
    nonlinear("rate(x)*(1 + rate(y)) - rate(x)*rate(y) = 1", "rate(x)*(1 + rate(y))", QUADRATIC, "cancel"),
    nonlinear("(rate(x)+1)**2 - rate(x)**2 = 3", "(rate(x)+1)**2", QUADRATIC, "without terms that cancel"),
    nonlinear("0*rate(x)**2 + rate(x) = 1", "rate(x)**2", QUADRATIC),
    Refusal(
        law("speed = 1", "definitions:\n  speed: rate(x)**2\n"),
        "nonlinear-differential",
        "speed",
        QUADRATIC,
        "write a law that is linear",
    ),
    *(
        Refusal(
            law(f"{at} = 1", f"parameters: {{n: 2}}\ndefinitions:\n  w: rate(x)\n  u: a.v\n  {more}\n"),
            "nonlinear-differential",
            at,
            f"`{at}` {reason}",
            "write a law that is linear",
        )
        for at, more, reason in (
            ("w*w", "", QUADRATIC),
            ("w**n", "", QUADRATIC),
            ("dot(u, u)", "", QUADRATIC),
            ("s", "s: norm(u)", PLAIN),
            ("k", "k: (w**2 + rate(y)**2)/2", QUADRATIC),
            ("w*s", "s: w + 1", QUADRATIC),
        )
    ),
    *(
        Refusal(
            CHAIN + f'differential:\n  l[i]: {{for: "i = 2..N", equation: "{at} = 0"}}\n',
            "nonlinear-differential",
            at,
            f"`{at}` {reason}",
            "write a law that is linear",
        )
        for at, reason in (
            ("p[i].vx*p[i-1].vy", QUADRATIC),
            ("dot(p[i].v - p[i-1].v, p[i].v)", QUADRATIC),
            ("norm(p[i].v)", PLAIN),
            ("p[i].vx**i", "is cubic in the velocities"),
        )
    ),
]
PLACES = [
    Refusal(
        row("a.vx + a.y = 1"), "velocity-not-allowed", "a.vx", "a holonomic constraint", "`differential`"
    ),
    Refusal(row("d(a.x) = 0"), "differential-not-allowed", "d(a.x)", "a holonomic", "under `differential`"),
    Refusal(law("d(d(x)) = 0"), "differential-not-allowed", "d(x)", "may not hold", "write one `d`"),
    Refusal(law("d(rate(x)) = 0"), "velocity-not-allowed", "rate(x)", "of positions", "law in accelerations"),
    Refusal(
        BALL + 'forces:\n  f: {potential: "dot(a.v, a.v)"}\n',
        "velocity-not-allowed",
        "a.v",
        "a potential may not depend on velocities",
        "declared with `to:` and `force:`",
    ),
    Refusal(
        KNIFE.replace("[1, 0, 0]", "[rate(x), 0, 0]"),
        "velocity-not-allowed",
        "rate(x)",
        "the position of a particle",
        "a position is x(q, t)",
    ),
    Refusal(KNIFE.replace("mass: 1", "mass: 1 + t"), "time-not-allowed", "t", "a mass", "thrust of a rocket"),
    Refusal(KNIFE.replace("mass: 1", "mass: x"), "position-not-allowed", "x", "a mass", "mass that varies"),
    Refusal(KNIFE.replace("mass: 1", "mass: 0"), "mass-not-positive", "0", "is 0", "massless stick"),
    Refusal(KNIFE.replace("mass: 1", "mass: -2"), "mass-not-positive", "-2", "is -2", "massless stick"),
    Refusal(KNIFE.replace("value: 0, rate: 1", "value: nan"), "unknown-name", "nan", "`nan`", "is finite"),
    Refusal(BALL + "rigid:\n  c: [a, b, a]\n", "duplicate-name", "a", "occurs twice", "each particle once"),
    Refusal(BALL + "rigid:\n  c: [a]\n", "too-few-particles", "[a]", "at least two", "nothing to hold"),
]
NO_ACCELERATION = "a law in accelerations is integrated"
ACCELERATIONS = [
    Refusal(law(equation), code, at, reason, hint)
    for equation, code, at, reason, hint in (
        ("rate(rate(x)) = 1", "bad-rate", "rate(rate(x))", "are accelerations", NO_ACCELERATION),
        ("rate(a.vx) = 1", "bad-rate", "rate(a.vx)", "are accelerations", NO_ACCELERATION),
        ("rate(a.v) = [0, 0, 0]", "bad-rate", "rate(a.v)", "are accelerations", NO_ACCELERATION),
        ("a.ax = 1", "result-not-allowed", "a.ax", "may not depend on accelerations", NO_ACCELERATION),
        ("ddot(x) = 1", "unknown-function", "ddot", "no function `ddot`", NO_ACCELERATION),
        ("xddot = 1", "unknown-name", "xddot", "not known", NO_ACCELERATION),
        ("d(a.vx) = dt", "velocity-not-allowed", "a.vx", "of positions and time", NO_ACCELERATION),
        ("xdot = 1", "unknown-name", "xdot", "not known", "write `rate(x)`"),
        ("y_dot = 1", "unknown-name", "y_dot", "not known", "write `rate(y)`"),
        ("dx = dt", "unknown-name", "dx", "not known", "`d(x)` for a differential"),
        ("diff(x, t) = 1", "unknown-function", "diff", "no function `diff`", "a time derivative is written"),
        ("x(t) = 1", "unknown-function", "x", "no function `x`", "without parentheses"),
        (
            "rate(x) = tension(rod)",
            "unknown-function",
            "tension",
            "no function",
            "constraint forces are results",
        ),
        (
            "rate(x) = Multiplier(law)",
            "unknown-function",
            "Multiplier",
            "no function",
            "did you mean `multiplier`?",
        ),
        (
            "rate(t) = 1",
            "wrong-arguments",
            "t",
            "the name of a coordinate, and `t` is none",
            "`d(...)` takes any",
        ),
        ("rate(x*y) = 1", "bad-rate", "x*y", "of a generalized coordinate", "`d(...)` takes any expression"),
        ("d(x) - rate(y) = 0", "mixed-forms", "rate(y)", "mixed in one equation", "write the whole law with"),
        ("d(x) = 1", "no-differential", "1", "this one holds none", "multiply it by `dt`"),
        (
            "x = 1",
            "no-differential",
            "x = 1",
            "needs differentials or velocities",
            "belongs under `holonomic`",
        ),
    )
]
RESULTS = [
    Refusal(
        force("[-0.3*norm(reaction(a)), 0, 0]"), "result-not-allowed", "reaction(a)", "the force on", "D.11"
    ),
    Refusal(
        force("[multiplier(rod), 0, 0]"),
        "result-not-allowed",
        "multiplier(rod)",
        "multipliers",
        "m*g on a level floor",
    ),
    Refusal(force("kinetic*v"), "result-not-allowed", "kinetic", "energies", "write the formula out"),
    Refusal(force("[energy, 0, 0]"), "unknown-name", "energy", "not known", "`kinetic + potential`"),
    Refusal(force("[lambda.rod, 0, 0]"), "unknown-name", "lambda", "not known", "`multiplier(NAME)`"),
    Refusal(force("[\u03bb, 0, 0]"), "unknown-name", "\u03bb", "not known", "`multiplier(NAME)`"),
    Refusal(row("r.x = 1"), "unknown-name", "r", "not known", "write the particle's name"),
    Refusal(row("v.x = 1"), "unknown-name", "v", "not known", "`a.vx` of a particle"),
    Refusal(row("a.x = m"), "unknown-name", "m", "not known", "under `parameters`"),
    Refusal(force("R"), "unknown-name", "R", "not known", "`reaction(NAME)`"),
    Refusal(
        force("[-N, 0, 0]") + "outputs: {N: norm(reaction(a))}\n",
        "used-before-declared",
        "N",
        "only later outputs",
        "outputs are results",
    ),
    Refusal(
        BALL + "definitions:\n  N: norm(reaction(a))\n",
        "result-not-allowed",
        "reaction(a)",
        "a definition",
        "D.11",
    ),
    Refusal(
        row("a.x = 1 + multiplier(h)"), "result-not-allowed", "multiplier(h)", "a holonomic", "may not enter"
    ),
    Refusal(row("kinetic = 1"), "result-not-allowed", "kinetic", "a holonomic", "write the formula out"),
    Refusal(
        BALL + 'forces:\n  f: {potential: "dot(reaction(a), a)"}\n',
        "result-not-allowed",
        "reaction(a)",
        "a potential",
        "record `reaction(a)` under `outputs`",
    ),
    *(
        Refusal(text, "result-not-allowed", at, subject, hint)
        for text, at, subject, hint in (
            (
                law("rate(x) = multiplier(law)"),
                "multiplier(law)",
                "a differential constraint",
                "may not enter",
            ),
            (law("dot(reaction(a), a.v) = 0"), "reaction(a)", "a differential constraint", "may not enter"),
            (law("d(multiplier(law)) = 0"), "multiplier(law)", "a differential", "may not enter"),
            (
                force("[0.1*abs(sin(multiplier(rod))), 0, 0]"),
                "multiplier(rod)",
                "the force on a particle",
                "D.11",
            ),
            (force("[potential, 0, 0]"), "potential", "the force on a particle", "write the formula out"),
            (
                lagrangian(
                    "rate(x)**2", more="holonomic: {h: x = 1}\nforces: {f: {to: x, force: multiplier(h)}}\n"
                ),
                "multiplier(h)",
                "a generalized force",
                "D.11",
            ),
            (
                CHAIN + 'forces:\n  f[i]: {for: "i = 2..N", to: p, force: "multiplier(link[i])*v"}\n',
                "multiplier(link[i])",
                "the force on a particle",
                "D.11",
            ),
            (
                CHAIN.replace('= 1"', '= norm(reaction(p[i]))"'),
                "reaction(p[i])",
                "a holonomic",
                "may not enter",
            ),
            (
                BALL + "rigid: {c: [a, b]}\nforces: {f: {to: a, force: multiplier(c.1)*v}}\n",
                "multiplier(c.1)",
                "the force on a particle",
                "D.11",
            ),
            (
                BALL.replace("mass: 2", "mass: norm(reaction(a))"),
                "reaction(a)",
                "a mass",
                "may not enter them",
            ),
            (BALL + "parameters: {k: kinetic}\n", "kinetic", "a parameter", "write the formula out"),
            (
                KNIFE.replace("0]}", "0]}\n  b: {mass: 1, position: [norm(reaction(a)), x, 0]}"),
                "reaction(a)",
                "the position",
                "may not enter",
            ),
            (
                BALL + "simulation: {duration: norm(reaction(a))}\n",
                "reaction(a)",
                "the setting `duration`",
                "may not enter",
            ),
        )
    ),
    Refusal(lagrangian("rate(x)**2 + kinetic"), "result-not-allowed", "kinetic", "a Lagrangian", "write the"),
]
METHODS = [
    Refusal(
        BALL + f"simulation: {{method: {name}}}\n",
        "bad-setting",
        name,
        f"no method `{name}`; there are",
        "",
        "check",
    )
    for name in (
        *(
            "rk45",
            "radau",
            "bdf",
            "verlet",
            "rattle",
            "shake",
            "symplectic",
            "euler",
            "DOP853",
            "implicit",
            "zzz",
        ),
    )
]
SETTINGS = [
    Refusal(BALL + f"simulation: {{{key}: {value}}}\n", code, value, reason, "")
    for key, value, code, reason in (
        ("duration", "-1", "bad-setting", "finite and not negative"),
        ("duration", "1e400", "not-finite", "not finite"),
        ("duration", "nan", "unknown-name", "`nan`"),
        ("duration", "1/0", "not-finite", "divides by zero"),
        ("samples", "1", "bad-setting", "both ends are counted"),
        ("output_step", "0", "bad-setting", "must be positive"),
        ("rtol", "0", "bad-setting", "between"),
        ("atol", "-1", "bad-setting", "positive"),
    )
]
INERTIA = [
    Refusal(
        lagrangian("x*rate(y) - y*rate(x)"), "no-inertia", "x", "is quadratic in its rate", "first order"
    ),
    Refusal(lagrangian("x*y"), "no-inertia", "x", "no acceleration", "give it a mass"),
    Refusal(
        lagrangian("rate(x)**2/2", more="holonomic: {h: x - y = 1}\n"),
        "no-inertia",
        "y",
        "`y`",
        "if one fixes it",
    ),
    Refusal(
        lagrangian("(rate(x)**2 + x**2*rate(y)**2)/2", "value: 0"),
        "no-inertia",
        "y",
        "vanishes",
        "start away",
    ),
    Refusal(lagrangian("rate(x)**3 + rate(y)**2"), "no-inertia", "x", "at the start", "with another rate"),
    Refusal(
        lagrangian("(rate(x) + 2*rate(y))**2/2"),
        "indefinite-inertia",
        "x",
        "(rate(x) = 1, rate(y) = -0.5)",
        "same motion",
    ),
    Refusal(
        lagrangian("(rate(x)**2 - rate(y)**2)/2"),
        "indefinite-inertia",
        "y",
        "motion (rate(y) = 1) is negative",
        "sign",
    ),
    Refusal(lagrangian("rate(x)*rate(y)"), "indefinite-inertia", "x", "is negative", "correct the sign"),
    Refusal(lagrangian("sqrt(rate(x)) + rate(y)**2"), "not-finite-at-start", "x", "inertia of `x`", "pole"),
]
ROWS = [
    *(
        Refusal(
            row(equation),
            "no-coordinates",
            f'"{equation}"',
            "its gradient vanishes everywhere",
            "take it out",
        )
        for equation in ("1 = 1", "t = 1", "0*a.x = 0", "sin(a.x)**2 + cos(a.x)**2 = 2", "sign(a.x) = 1")
    ),
    *(
        Refusal(row(equation), "kink-at-start", f'"{equation}"', "jumps at the start", "branch")
        for equation in (
            "max(a.x, 1) = 1",
            "min(a.x, 1) = 1",
            "abs(a.y) = 0",
            "max(a.y, a.z) = 0",
            "a.z = sign(a.y)",
        )
    ),
    *(
        Refusal(row(equation), "not-finite-at-start", f'"{equation}"', "not finite at the start", "pole")
        for equation in ("sqrt(a.y) = 0", "1/a.y = 1", "acos(a.x) = 0", "norm([a.y, a.z, 0]) = 0")
    ),
]
TABLE = [
    *(NONLINEAR + PLACES + ACCELERATIONS + RESULTS + METHODS + SETTINGS),
    *(dataclasses.replace(case, command="simulate") for case in INERTIA),
    *(
        dataclasses.replace(case, command=command)
        for case in ROWS
        for command in ("check", "dof", "simulate")
    ),
]


def refused(
    case: Refusal, folder: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> tuple[int, str, str]:
    """Exit code, stdout and stderr of the command on the model."""
    (folder / "model.yaml").write_text(case.text, encoding="utf-8")
    monkeypatch.chdir(folder)
    monkeypatch.setattr(interrupts, "install", lambda: None)  # signal handlers stay pytest's
    monkeypatch.setattr(sys, "argv", ["lagcli", case.command, "model.yaml"])
    with pytest.raises(SystemExit) as end:
        entry.main()
    out, err = capfd.readouterr()
    assert isinstance(end.value.code, int)
    return end.value.code, out, err


@pytest.mark.parametrize("case", TABLE, ids=lambda case: f"{case.command} {case.code} {case.at}")
def test_it_is_refused_with_location_reason_and_way_out(
    case: Refusal, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    code, out, err = refused(case, tmp_path, monkeypatch, capfd)
    assert (code, out) == (case.exit, "")
    head, source, carets, *rest = err.splitlines()
    assert head.startswith("model.yaml:")
    assert f": error[{case.code}]: " in head
    assert case.reason in head
    begin, end = carets.index("^"), carets.rindex("^") + 1
    assert source[begin:end] == case.at
    line, column = (int(number) for number in head.split(":")[1:3])
    assert case.text.splitlines()[line - 1][column - 1 :].startswith(case.at)
    if case.hint:
        assert rest[0].startswith("  hint: ")
        assert case.hint in rest[0]
    assert "Traceback" not in err
    assert catalogue.page(case.code) is not None


@pytest.mark.parametrize("text", [case.text for case in INERTIA[:-1]])
def test_a_model_without_inertia_can_be_counted(text: str) -> None:
    assert lagcli.dof(lagcli.loads(text)).configuration_dof in (1, 2)
    assert lagcli.check(lagcli.loads(text)).warnings


def test_inertia_is_asked_for_where_the_start_is_assembled() -> None:
    text = lagrangian("rate(x)**2 + x**2*rate(y)**2", more="holonomic: {h: x = 0}\n")
    with pytest.raises(
        lagcli.ModelError, match=r"no-inertia\]: the coordinate `y` has no inertia at the start"
    ):
        lagcli.simulate(lagcli.loads(text), assemble=True)


# An inertia that is lost on the way stops the run, and the reason names the motion.
@pytest.mark.parametrize(
    ("text", "motion"),
    [
        (lagrangian("rate(x)**4/4 - x**2/2 + rate(y)**2", "value: 1, rate: 1"), "(rate(x) = 1)"),
        (lagrangian("cos(x)*rate(x)**2/2 + rate(y)**2", "value: 0, rate: 1"), "(rate(x) = 1)"),
        (lagrangian("rate(x)**2 - 2*sin(t)*rate(x)*rate(y) + rate(y)**2 + x"), "(rate(x) = 1, rate(y) = 1)"),
    ],
)
def test_an_inertia_lost_on_the_way_stops_with_the_reason(text: str, motion: str) -> None:
    # With an absolute tolerance: velocities here go through zero like a cube root, which a looser one passes.
    with pytest.raises(lagcli.SimulationStopped) as caught:
        lagcli.simulate(lagcli.loads(text), duration=3, samples=4, atol=1e-13)
    assert f"the inertia of the motion {motion} is " in caught.value.reason
    assert np.isfinite(caught.value.trajectory["x"]).all()


def test_another_stop_does_not_speak_of_inertia() -> None:
    with pytest.raises(lagcli.SimulationStopped) as caught:
        lagcli.simulate(lagcli.loads(force("[1/(r.y + 1)**3, -9/(1.01 - t)**2, 0]")), duration=3, samples=4)
    assert "inertia" not in caught.value.reason


def test_a_family_names_what_a_scheme_of_another_program_is() -> None:
    base = run_settings.chosen(lagcli.loads(BALL), {})
    for name, words in (
        ("rk45", "of order 8"),
        ("BDF", "stiff"),
        ("shake", "projection"),
        ("dop835", "`dop853`"),
    ):
        ((key, sentence),) = settings.faults(dataclasses.replace(base, method=name))
        assert key == "method"
        assert words in sentence


def test_errors_as_data_hold_code_location_and_hint(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "model.yaml").write_text(law("rate(x)**2 = 1"), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(interrupts, "install", lambda: None)
    monkeypatch.setattr(sys, "argv", ["lagcli", "check", "--json", "model.yaml"])
    with pytest.raises(SystemExit):
        entry.main()
    (error,) = json.loads(capfd.readouterr().out)["errors"]
    assert (error["code"], error["line"], error["column"]) == ("nonlinear-differential", 9, 9)
    assert "d'Alembert" in error["hint"]


# What looks like the refused and is not: each is read, counted and run.
LINEAR = [
    "rate(y)*cos(x) + x*rate(y) = 0",
    "rate(y)*(x**2 + y**2) = 0",
    "x**2*rate(y) = 0",
    "rate(y)*norm([x, y, 1]) = 0",
    "rate(y)/(1 + x**2) = 0",
    "rate(y)*distance(a, [0, 0, 0]) = 0",
    "rate(y)*abs(x + 1) = 0",
    "sqrt(1 + x**2)*rate(y) = 0",
    "rate(y)**1 = 0",
    "rate(y)*rate(x)**0 = 0",
    "-(-rate(y)) = 0*t",
    "rate(x) = 1",
    "rate(y) = x*y",
    "dot(rate(a), a) = 0",
    "dot(a.v, a + [x, y, 0]) = 0",
    "cross(a.v, [0, 0, 1]) = [0, 0, 0]",
    "a.v = [0, 0, 0]",
    "d(norm(a)) = 0",
    "d(y)*sin(x) = 0*dt",
    "d(atan2(y, x + 1)) + y/((x + 1)**2 + y**2)*d(x) = 0",
]
ACCEPTED = [
    *(law(equation) for equation in LINEAR),
    law("w**one*cos(x) = 0", "parameters: {one: 1}\ndefinitions:\n  w: rate(y)\n"),
    law("w**(n - 1) = 0", "parameters: {n: 2}\ndefinitions:\n  w: rate(y)\n"),
    law("dot(u, a) = 0", "definitions:\n  u: a.v + cross([0, 0, 1], a.v)\n"),
    CHAIN + 'differential:\n  l[i]: {for: "i = 1..N", equation: "i*p[i].x**i*p[i].vz = 0"}\n',
    force("-0.3*norm(v)*v"),
    force("-0.3*dot(v, v)*v + [exp(-v.x), 0, 0]"),
    force("[-0.1*sign(v.y + 1), abs(r.x), a.vx*b.vy]"),
    force("-0.2*9.81*m*v/sqrt(dot(v, v) + 1e-6)")
    + "outputs: {N: norm(reaction(a)), T: 2*N + multiplier(rod)}\n",
    BALL + 'forces: {f: {potential: "distance(a, b)**2*(1 + t) + abs(a.x)"}}\n',
    lagrangian("rate(x)**4/4 + rate(x)**2/2 + rate(y)**2"),
    lagrangian("rate(x)**4/4 + rate(y)**2", "value: 1, rate: 1"),
    lagrangian("rate(x)**2 + rate(y)**2 + rate(x)*rate(y)"),
    lagrangian("(rate(x) + rate(y))**2 + rate(y)**2"),
    lagrangian("rate(x)**2 + rate(y)**2 + x*rate(y) - y*rate(x) + t*rate(x)"),
    lagrangian("rate(x)**2*rate(y)**2/10 + rate(x)**2 + rate(y)**2"),
    lagrangian("-sqrt(1 - rate(x)**2/100 - rate(y)**2/100)"),
    lagrangian("exp(rate(x)) + cosh(rate(y))"),
    lagrangian("1e-12*rate(x)**2 + 1e6*rate(y)**2"),
    *(BALL + f"simulation: {{method: {name}}}\n" for name in (*settings.METHODS, '"dop853"')),
]


@pytest.mark.parametrize("text", ACCEPTED, ids=lambda text: text.splitlines()[-1])
def test_what_only_looks_like_the_refused_is_taken(text: str) -> None:
    model = lagcli.loads(text)
    report = lagcli.check(model)
    assert report.initial.consistent
    run = lagcli.simulate(model, duration=0.01, samples=2)
    assert np.isfinite(run["energy"]).all()


def test_an_exponent_that_a_parameter_gives_is_that_number() -> None:
    text = law("w**n*y + rate(y)*x**n = 0", "parameters: {n: 1}\ndefinitions: {w: rate(x)}\n")
    (found,) = lagcli.check(lagcli.loads(text)).constraints
    assert (found.verdict.kind, found.verdict.integral) == ("exact", "x*y")
    with pytest.raises(lagcli.ModelError, match="quadratic in the velocities"):
        lagcli.loads(text, parameters={"n": 2})


# A switch that the motion does not meet, or across which the gradient does not jump, is no reason to refuse.
SMOOTH = [
    row("abs(a.x) = 1"),
    row("max(a.x, 0.5) = 1"),
    row("max(a.y, 0)**2 + a.x = 1"),
    row("a.x + abs(a.y)*a.y = 1"),
    row("a.x = 1 + max(t - 5, 0)"),
    row("a.y**3 + a.x = 1"),
]


@pytest.mark.parametrize("text", SMOOTH)
def test_a_switch_without_a_jump_is_taken(text: str) -> None:
    assert lagcli.simulate(lagcli.loads(text))["a.x"][-1] == pytest.approx(1.0)


def test_rows_without_switches_cost_nothing() -> None:
    assert mechanics.build(lagcli.loads(row("a.x = 1"))).kinks is None
