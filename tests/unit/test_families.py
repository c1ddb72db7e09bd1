"""A family must give exactly what the same model written out entry by entry gives."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import json
import re
from collections.abc import Mapping
from typing import Any
from unittest import mock

import casadi
import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

import lagcli
from lagcli import memory
from lagcli.equations import family_rows, system
from lagcli.errors import diagnostics
from lagcli.input import overrides
from lagcli.pfaffian import frobenius
from tests.helpers import systems, written_out
from tests.helpers.spent import at_most_calls

TOLERANCE = 1e-12

CHAIN = """\
lagcli: 1
parameters: {N: 6, L: 0.5, m: 0.2, g: 9.81, N2: 2*N}
particles:
  anchor: {mass: 1, position: [0, 0, 0]}
  p[i]: {for: "i = 1..N", mass: m*(1 + i/10), position: "[i*L, 0, 0]", velocity: [0, 0, 0]}
forces:
  weight: {to: p, force: [0, 0, -m*g]}
holonomic:
  hold: anchor = [0, 0, 0]
  hook: distance(p[1], anchor) = L
  link[i]: {for: "i = 2..N", equation: "distance(p[i-1], p[i]) = L"}
outputs:
  tension[i]: {for: "i = 2..N", expression: "multiplier(link[i])/i"}
  end: p[N].x + multiplier(link[2]) + multiplier(hook)
  pull[k]: {for: "k = 1..N/2", expression: "reaction(p[2*k-1])"}
  speed[k]: {for: "k = 1..N", expression: "norm(p[N+1-k].v) + k**2/3"}
  E: kinetic + potential
"""

# Each is a document; the comment says what it has that no other has.
MODELS = {
    "chain": CHAIN,
    "empty and single": """\
lagcli: 1
parameters: {N: 1}
particles:
  p[i]: {for: "i = 1..N", mass: 1, position: "[i, 0, 0]", velocity: [0, 1, 0]}
  none[i]: {for: "i = 2..N", mass: 1, position: "[i, 0, 0]"}
coordinates:
  q[i]: {for: "i = 2..N", value: 1}
  u[i]: {for: "i = 0..0", value: "i", rate: 1}
forces:
  f: {to: none, force: [0, 0, -1]}
  g: {to: q, force: 1}
  h[i]: {for: "i = 5..N", to: "p[i]", force: [1, 0, 0]}
  w[i]: {for: "i = 5..N", potential: "p[i].x"}
  gen[i]: {for: "i = 5..N", to: "q[i]", force: "q[i]"}
  s[i]: {for: "i = 0..0", potential: "u[i]**2/2"}
lagrangian: rate(u[0])**2/2
holonomic:
  one[i]: {for: "i = 1..N", equation: "p[i].z = 0"}
  link[i]: {for: "i = 2..N", equation: "distance(p[i], p[i-1]) = 1"}
differential:
  d[i]: {for: "i = 2..N", equation: "d(p[i].x) = 0"}
outputs:
  o[i]: {for: "i = 2..N", expression: "p[i]"}
  c[i]: {for: "i = 1..N", expression: "p[i] + multiplier(one[i])*[1, 0, 0]"}
""",
    "grid with filter": """\
lagcli: 1
parameters: {N: 3, M: 2, k: 7, m: 1.5}
particles:
  p[i][j]: {for: ["i = 1..N", "j = 1..M"], mass: "m + i*j/10",
            position: "[i, j, sin(i+j)/9]", velocity: "[0.1*i, -0.1*j, 0]"}
forces:
  weight: {to: all, force: [0, 0, -m*9.81]}
  h[i][j]: {for: ["i = 1..N-1", "j = 1..M"], potential: "k/2*(distance(p[i][j], p[i+1][j]) - 1)**2"}
  v[i][j]: {for: ["i = 1..N", "j = 1..M-1"], to: ["p[i][j]", "p[i][j+1]"], force: "-k*i*(r - [i, j, 0])"}
holonomic:
  rim[i][j]: {for: ["i = 1..N", "j = 1..M"], if: "i == 1 or i == N and j == M", equation: "p[i][j].z = sin(i+j)/9"}
  pair[i][j]: {for: ["i = 1..N", "j = i+1..N"], if: "not (i == 1 and j == 3)",
               equation: "distance(p[i][1], p[j][2])**2/2 = ((i-j)**2 + 1 + (sin(i+1) - sin(j+2))**2/81)/2"}
outputs:
  z[j][i]: {for: ["i = 1..N", "j = 1..M"], expression: "p[i][j].z*p[N+1-i][M+1-j].vx"}
  s[i]: {for: "i = 1..N", expression: "sin(i)*p[i][M].y + p[2*i-i][min(i, M)].x"}
  l[i]: {for: "i = 1..1", expression: "multiplier(rim[i][i]) + multiplier(pair[2][3])"}
""",
    "pendulum in angles": """\
lagcli: 1
parameters: {N: 5, L: 0.7, m: 0.3}
coordinates:
  a[i]: {for: "i = 1..N", value: "0.3 + i/10", rate: "(-1)**i/5"}
particles:
  p[1]: {mass: m, position: "[L*sin(a[1]), 0, -L*cos(a[1])]"}
  p[i]: {for: "i = 2..N", mass: "m/i", position: "p[i-1] + [L*sin(a[i]), 0, -L*cos(a[i])]"}
forces:
  weight: {to: p, force: [0, 0, -m*9.81]}
  drag[i]: {for: "i = 1..N", to: "p[i]", force: "-0.1*i*v"}
  motor[i]: {for: "i = 1..N", to: "a[i]", force: "-0.05*i*rate(a[i])"}
  motors: {to: a, force: 0.01*t}
  two: {to: ["a[1]", "a[N]"], force: 0.03}
outputs:
  w[i]: {for: "i = 1..N", expression: "rate(a[i])/i"}
  R[i]: {for: "i = 1..N", expression: "0"}
  react[i]: {for: "i = 1..N", expression: "reaction(p[i])"}
  v[i]: {for: "i = 1..N", expression: "p[i].v + rate(p[N+1-i])"}
""".replace('  R[i]: {for: "i = 1..N", expression: "0"}\n', ""),
    "all pairs": """\
lagcli: 1
parameters: {N: 4, G: 1.3}
particles:
  p[i]: {for: "i = 1..N", mass: "1 + i", position: "[2*cos(i), 2*sin(i), i/3]", velocity: "[-sin(i)/2, cos(i)/2, 0]"}
forces:
  f[i][j]: {for: ["i = 1..N", "j = 1..N"], if: "i != j", to: "p[i]",
            force: "-G*(1 + i)*(1 + j)*(p[i] - p[j])/distance(p[i], p[j])**3"}
  own[j]: {for: "j = 1..N", to: [p], force: "G*m/j*[1, 0, 0] - v/j"}
  const[j]: {for: "j = 1..N", to: ["p[j]", "p[1]"], force: "[m/j, 0, j**0.5]"}
outputs:
  sum: p[1].v + 2*p[2].v
""",
    "rigid bodies": """\
lagcli: 1
parameters: {N: 5}
particles:
  a: {mass: 1, position: [0, 0, 1], velocity: [0.1, 0, 0]}
  p[i]: {for: "i = 1..N", mass: "i", position: "[cos(i), sin(i), i**2/10]", velocity: [0.1, 0, 0]}
  s[i]: {for: "i = 1..3", mass: 1, position: "[i, 9, 0]"}
forces:
  f: {to: p, force: "[0, 0.3, -m]"}
  g: {to: "s[2]", force: "[0, 1, t]"}
rigid:
  body: [p, a]
  line: ["s[1]", "s[2]"]
outputs:
  l: multiplier(body.1) + multiplier(line.1)
simulation: {keep: [p, "s[1].x", a.y]}
""",
    "rigid family alone": """\
lagcli: 1
particles:
  p[i]: {for: "i = -1..1", mass: 1, position: "[i, abs(i), 0]"}
forces: {f: {to: "p[-1]", force: [0, 0, 1]}}
rigid: {body: p}
simulation: {keep: "p[-1]"}
""",
    "wheels": """\
lagcli: 1
parameters: {N: 5, R: 0.5, w: [0.1, 0.2, 0.3]}
coordinates:
  x[i]: {for: "i = 1..N", value: "i", rate: "R*cos(i)"}
  y[i]: {for: "i = 1..N", value: "0", rate: "R*sin(i)"}
  theta[i]: {for: "i = 1..N", value: "i"}
  phi[i]: {for: "i = 1..N", value: "0", rate: 1}
lagrangian: "0.2*dot(w, w)*x[1]"
particles:
  c[i]: {for: "i = 1..N", mass: 2, position: "[x[i], y[i], w.x]"}
  o[i]: {for: "i = 1..N", mass: 0.5,
         position: "c[i] + R*[cos(theta[i])*cos(phi[i]), sin(theta[i])*cos(phi[i]), sin(phi[i])]"}
  s[i]: {for: "i = 1..N", mass: 0.3, position: "c[i] + [-sin(theta[i]), cos(theta[i]), 0]*i"}
differential:
  along[i]: {for: "i = 1..N", equation: "d(x[i]) - R*cos(theta[i])*d(phi[i]) = 0"}
  across[i]: {for: "i = 1..N", equation: "rate(y[i]) = R*sin(theta[i])*rate(phi[i])"}
outputs:
  force[i]: {for: "i = 1..N", expression: "multiplier(along[i])*cos(theta[i]) + rate(phi[i])"}
""",
    "vector laws": """\
lagcli: 1
parameters: {N: 5, c: [1, 0.5, 0]}
coordinates:
  s[i]: {for: "i = 1..2", value: "i", rate: 0.5}
particles:
  p[i]: {for: "i = 1..N", mass: "i", position: "i*c", velocity: "[0.3, 0, 0]"}
  q[i]: {for: "i = 1..N", mass: 1, position: "i*c + [0, 0, 1]", velocity: "[0.3, 0, 0]"}
  d[i]: {for: "i = 1..2", mass: 2, position: "[s[i], i*t, s[i]**2]"}
holonomic:
  glue[i]: {for: "i = 1..N", equation: "q[i] - p[i] = [0, 0, 1]"}
differential:
  same[i]: {for: "i = 1..N-1", equation: "p[i+1].v - p[i].v = 0"}
  form[i]: {for: "i = 1..1", equation: "d(p[i]) - [0.3, 0, 0]*dt = 0"}
outputs:
  l[i]: {for: "i = 1..N", expression: "multiplier(glue[i]) + [0, 0, multiplier(glue[i].x)]"}
  m: multiplier(same[2]) + multiplier(glue[N]) + multiplier(same[1].z)*c
  z[i]: {for: "i = 1..N", expression: "l[i] + l[N+1-i].x*m"}
""",
    "same coordinate twice": """\
lagcli: 1
parameters: {N: 7}
particles:
  p[i]: {for: "i = 1..N", mass: 1, position: "[i, 0, i/2]", velocity: [0, 1, 0]}
forces:
  f: {to: all, force: "[sin(r.x), -m, cos(t)]"}
holonomic:
  mirror[i]: {for: "i = 1..N", if: "i <= (N + 1)/2",
              equation: "p[i].x + p[N+1-i].x + p[i].x*p[N+1-i].x/10 = N + 1 + i*(N+1-i)/10"}
  next[i]: {for: "i = 1..N-1",
            equation: "p[i].z*p[max(i, 3)].z + p[min(i+1, 4)].z**2 = i*max(i, 3)/4 + min(i+1, 4)**2/4"}
differential:
  d[i]: {for: "i = 1..N", if: "i != 4", equation: "p[i].vy + (p[i].x - i)*p[N+1-i].vx = 1"}
""",
    "many functions": """\
lagcli: 1
parameters: {N: 5, e: 2, w: [0.5, 1, 1.5], L: 1}
definitions:
  ramp: t**2/2 + p[1].x*0
  far: p[2] - p[1]
  both: norm(far) + q[2]
coordinates:
  q[i]: {for: "i = 1..N", value: "i/4", rate: "0.1/i"}
particles:
  p[i]: {for: "i = 1..N", mass: "max(1, i/2)", position: "[i, -i, 2]", velocity: [0, 0, 0]}
forces:
  h[i]: {for: "i = 1..N", potential: "i**e*q[i]**i/20 + abs(q[i]-i)**2 + i/2*both/9"}
  s[i]: {for: "i = 1..N", to: "p[i]", force: "[sqrt(i)*max(r.x, i/2), min(r.y, i)*sign(i - 3), e**(-i)] + far/i"}
lagrangian: "rate(q[1])**2/2 + rate(q[2])**2/2 + rate(q[3])**2 + rate(q[4])**2 + rate(q[5])**2/3"
holonomic:
  moving[i]: {for: "i = 1..N", equation: "max(p[i].x, i - 3) = i + 0*ramp"}
  free[i]: {for: "i = 1..N", equation: "p[i].y*sqrt(i) + abs(p[i].y)*sign(p[i].y)*i = -i*sqrt(i) - i**2 - ramp*i/10"}
  power[i]: {for: "i = 1..N", equation: "p[i].z**i + p[i].z**(i/2) = 2**i + 2**(i/2)"}
outputs:
  x[i]: {for: "i = -2..3", expression: "q[abs(i)+1]**i + i*dot(w, far) + atan2(i, 2) + ramp"}
  y[i]: {for: "i = 1..N", expression: "i*w + q[i]*[1, 2, i]"}
""",
    "rheonomic": """\
lagcli: 1
parameters: {N: 5, A: 0.2, om: 3, L: 1}
particles:
  p[i]: {for: "i = 1..N", mass: 1, position: "[i*L, 0, 0]", velocity: "[0, 0, A*om*i]"}
  q[i]: {for: "i = 1..N", mass: 1, position: "[i*L, 0, -L]", velocity: "[0, 0, A*om*i]"}
forces:
  weight: {to: q, force: [0, 0.2, -m*9.81]}
holonomic:
  drive[i]: {for: "i = 1..N", equation: "p[i] = [i*L, 0, A*i*sin(om*t)]"}
  rod[i]: {for: "i = 1..N", equation: "distance(p[i], q[i]) = L"}
differential:
  slow[i]: {for: "i = 1..N", equation: "t*d(q[i].x) - i*(q[i].x - i*L)*dt + t**2*i*q[i].y*dt = 0"}
simulation: {start: 0.2, assemble: true}
""",
    "members that need members": """\
lagcli: 1
parameters: {N: 9}
coordinates:
  u: {value: 0.3, rate: 1}
  w[i]: {for: "i = 1..2", value: "i", rate: "-i"}
definitions:
  a: p[1] + [0, 0, u]
  b: 2*p[4].x
particles:
  p[i]: {for: "i = 2..N", if: "i != 4", mass: "i", position: "p[i-1]*cos(u/i) + [0, i, w[min(i, 2)]]"}
  p[4]: {mass: 4, position: "a + p[2]"}
  p[1]: {mass: 1, position: "[u, w[1], w[2]]"}
  e[i]: {for: "i = 1..N", mass: 1, position: "p[N+1-i] + b*[1, 0, 0]"}
forces:
  f: {to: [p, "e[1]", e], force: "[0, 0, -m] - v/9"}
""",
}


def as_written(found: Any) -> Any:
    """A report with the names as they are written out."""
    if isinstance(found, dict):
        return {key: as_written(value) for key, value in found.items()}
    if isinstance(found, list):
        return [as_written(value) for value in found]
    return written_out.name(found) if isinstance(found, str) else found


@dataclasses.dataclass(frozen=True)
class WrittenOut:
    """A model written out, and what is said of it as JSON texts; which nothing about families can change."""

    model: lagcli.Model
    count: str
    report: str
    run: lagcli.Trajectory


@functools.cache
def plainly(text: str, duration: float) -> WrittenOut:
    model = lagcli.loads(text)
    count, report = (json.dumps(say(model).as_json()) for say in (lagcli.dof, lagcli.check))
    return WrittenOut(model, count, report, lagcli.simulate(model, duration=duration, samples=5))


def require_same(document: str, changes: Mapping[str, str] | None = None, duration: float = 0.2) -> None:
    """The model and the model written out are one."""
    family = lagcli.loads(document, changes)
    known = plainly(written_out.text(document, changes), duration)
    plain = known.model
    assert [written_out.name(name) for name in family.coordinate_names] == list(plain.coordinate_names)
    assert [written_out.name(name) for name in family.particle_names] == list(plain.particle_names)
    assert [written_out.name(name) for name in family.simulation.keep] == list(plain.simulation.keep)
    assert through_text(lagcli.dof(family)) == json.loads(known.count)
    require_same_reports(through_text(lagcli.check(family)), json.loads(known.report))
    one, other = lagcli.simulate(family, duration=duration, samples=5), known.run
    assert [written_out.name(column) for column in one.columns] == list(other.columns)
    for column, mine, theirs in zip(one.columns, one.rows.T, other.rows.T, strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=TOLERANCE, atol=TOLERANCE, err_msg=column)


def through_text(found: Any) -> Any:
    """What is said as JSON, read again."""
    return json.loads(json.dumps(found.as_json()))


def require_same_reports(family: Any, other: Any) -> None:
    """Verdicts and counts agree to the letter; a warning about a family is one about each of its members."""
    one = as_written(family)
    for report in (one, other):
        report["warnings"] = {warning["code"] for warning in report["warnings"]}
        initial = report["initial"]
        for residual in ("position_residual", "velocity_residual"):
            initial[residual] = round(initial[residual], 11)
    assert one == other


@pytest.mark.parametrize("worth", [0, 4, 1000])
@pytest.mark.parametrize("name", MODELS)
def test_a_family_is_what_it_is_written_out(name: str, worth: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(family_rows, "WORTH", worth)
    memory.forget()
    require_same(MODELS[name])


# -- random families ---------------------------------------------------------------------------------------------

ONE_INDEX = ("i", "N+1-i", "min(i+1, N)", "max(i-1, 1)", "1", "N", "2*i - i")
NO_INDEX = ("1", "N", "(N+1)/2*2 - N")
PLACES = ("i", "i/2", "(i - 2)", "k**i", "t", "n3.x", "L", "far", "i**2")
FOR = ('"i = 1..N"', '["i = 1..N"]', '"i = 1..N", if: "i != 2"', '"i = 1..N", if: "i <= 3 or i == N"')
GRID = '["i = 1..N", "j = i..M"], if: "i + j != 4 or i == 1"'


def leaves(draw: st.DrawFn, indices: tuple[str, ...], rates: bool = False) -> list[str]:
    """Scalars of a member of a family over i, or of what is none."""

    def at() -> str:
        return draw(st.sampled_from(indices))

    words = ("t", "n3.x", "far") if indices is NO_INDEX else PLACES
    found = [f"p[{at()}].x", f"q[{at()}]", f"d[{at()}].y", "u[1][1].z*u[1][4].x"]
    found += [f"dot(p[{at()}], n3)", f"norm(p[{at()}] - d[{at()}] + [9, 9, 9])", draw(st.sampled_from(words))]
    found += [f"max(p[{at()}].x, {at()})", f"abs(q[{at()}] - 1/3)", f"sign(p[{at()}].y)*sqrt(2 + {at()})"]
    if indices is not NO_INDEX:
        found += ["(2 + p[i].z**2)**(i/2)", "q[i]**i", "p[i].y*i"]
    if rates:
        found += [
            f"rate(q[{at()}])",
            f"p[{at()}].vx",
            f"d[{at()}].vz",
            f"rate(p[{at()}].y)",
            f"rate(d[{at()}].x)",
        ]
    return found


@st.composite
def documents(draw: st.DrawFn) -> str:
    """A model of families: not one with a consistent start, but one with all its functions."""
    count, inner = draw(st.integers(1, 6)), draw(st.integers(1, 3))

    def scalar(rates: bool = False, indices: tuple[str, ...] = ONE_INDEX) -> str:
        return draw(systems.formulas(leaves(draw, indices, rates), depth=1))

    def vector(rates: bool = False) -> str:
        return "[" + ", ".join(scalar(rates) for _ in "xyz") + "]"

    def family(entry: str, **fields: str) -> str:
        told = ", ".join(f'{key}: "{value}"' for key, value in fields.items())
        return f"  {entry}[i]: {{for: {draw(st.sampled_from(FOR))}, {told}}}"

    angles = "[sin(q[i]) + i*t, q[N+1-i]*k, " + draw(st.sampled_from(("0", "i", "near", "q[1]**2"))) + "]"
    lines = ["lagcli: 1", "parameters:", f"  N: {count}", f"  M: {inner}"]
    lines += [f"  {name}: {value}" for name, value in systems.PARAMETERS.items()]
    lines += [
        "definitions:",
        "  near: t/2 + q[1]*k",
        "  far: near*p[N].x",
        "coordinates:",
        '  q[i]: {for: "i = 1..N", value: i/7}',
    ]
    lines += ["particles:", '  p[i]: {for: "i = 1..N", mass: "1 + i/k", position: "[i, k, 0]"}']
    lines += [
        f'  u[i][j]: {{for: {GRID}, mass: 2, position: "[i, j, 0]"}}',
        "  u[1][4]: {mass: 1, position: n3}",
    ]
    follow = draw(st.sampled_from(("d[i-1] + ", "", "d[i-1]*cos(q[i]) + ", "d[1] - ")))
    lines += ['  d[1]: {mass: k, position: "[q[1]**2, near, t]"}']
    lines += [f'  d[i]: {{for: "i = 2..N", mass: i, position: "{follow}{angles}"}}']
    lines += [
        "forces:",
        '  a: {to: [p, "d[1]"], force: "[sin(r.x), m, k]"}',
        '  b: {to: all, force: "-m*n3"}',
    ]
    lines += [family("c", to="p[" + draw(st.sampled_from(ONE_INDEX)) + "]", force=vector(rates=True))]
    lines += [family("e", to="d[i]", force=vector()), family("f", to="q[i]", force=scalar(rates=True))]
    lines += [family("g", potential=scalar()), f'  h: {{potential: "{scalar(indices=NO_INDEX)}"}}']
    lines += ["holonomic:", family("la", equation=f"p[i].x + {scalar()} = {scalar()}")]
    lines += [family("lb", equation=f"p[i] - d[N+1-i] = {vector()}")]
    lines += [f'  lc[i][j]: {{for: {GRID}, equation: "u[i][j].x*i = {scalar()} + j"}}']
    lines += [
        "differential:",
        family("da", equation=f"({scalar()})*d(p[i].x) + i*d({scalar()}) + far*dt = 0"),
    ]
    lines += [family("db", equation=f"rate(q[i])*({scalar()}) + d[i].vx*i + p[N+1-i].vy = {scalar()}")]
    lines += [family("dc", equation="p[i].v*k = i*rate(p[N+1-i]) + d[i].v - q[i]*n3")]
    lines += ["outputs:", family("oa", expression=scalar(rates=True)), f"  ob: {scalar(True, NO_INDEX)}"]
    lines += [
        family(
            "oc", expression="multiplier(lb[1])*i + reaction(d[i]) + multiplier(la[1])*p[i].v + kinetic*n3"
        )
    ]
    lines += ['  od[i]: {for: "i = 1..1", expression: "oa[i]*oc[i].x + multiplier(dc[i].z) + potential"}']
    return "\n".join(lines) + "\n"


def functions(built: system.System) -> list[Any]:
    """All that the system of a model says at three points, arrays."""
    dynamics, rows = built.dynamics, built.rows
    inputs = [built.symbols.t, built.symbols.q, built.symbols.v, built.p, built.lam, built.a]
    outputs = [dynamics.M, dynamics.h, dynamics.kinetic, dynamics.potential, dynamics.energy, dynamics.power]
    outputs += [
        dynamics.jacobi,
        dynamics.rest,
        rows.f,
        rows.B,
        rows.b,
        rows.gamma,
        built.R,
        built.r,
        built.outputs,
    ]
    function = casadi.Function("all", inputs, outputs)
    found = []
    for seed in range(3):
        random = np.random.default_rng(seed)
        point = [random.normal(size=part.numel()) for part in inputs]
        point[3] = system.values(built)
        found += [np.array(part) for part in function(*point)]
    return found


@settings(
    max_examples=25,
    deadline=None,
    phases=(Phase.explicit, Phase.reuse, Phase.generate),  # shrinking takes minutes: a model is slow
    suppress_health_check=list(HealthCheck),
)
@given(documents(), st.sampled_from((0, 4, 1000)))
def test_random_families_are_what_they_are_written_out(document: str, worth: int) -> None:
    family, plain = lagcli.loads(document), lagcli.loads(written_out.text(document))
    try:
        with mock.patch.object(family_rows, "WORTH", worth):
            of_family = system.build(family)
            ours = functions(of_family)
    except lagcli.ModelError as error:  # a law may by chance hold no coordinate
        codes = {found.code for found in error.diagnostics}
        with pytest.raises(lagcli.ModelError) as caught:
            functions(system.build(plain))
        assert {found.code for found in caught.value.diagnostics} == codes
        return
    of_plain = system.build(plain)
    assert list(map(written_out.name, system.build(family).columns)) == list(of_plain.columns)
    for mine, theirs in zip(ours, functions(of_plain), strict=True):
        assert mine.shape == theirs.shape
        scale = 1 + np.nanmax(np.abs(theirs), initial=0)
        np.testing.assert_allclose(mine, theirs, rtol=1e-10, atol=1e-10 * scale)


# -- errors ------------------------------------------------------------------------------------------------------

HEAD = "lagcli: 1\nparameters: {N: 4, h: 2.5, w: [1, 2, 3], big: 1e6}\n"
POINTS = HEAD + 'particles:\n  p[i]: {for: "i = 1..N", mass: 1, position: "[i, 0, 0]"}\n'
ANGLES = HEAD + "coordinates: {q: {}}\nparticles:\n"


def particle(entry: str, rest: str = "mass: 1, position: [0, 0, 0]") -> str:
    return f"{HEAD}particles:\n  {entry}, {rest}}}\n"


def law(equation: str) -> str:
    return POINTS + f'holonomic:\n  l[i]: {{for: "i = 1..N", equation: "{equation}"}}\n'


def output(expression: str) -> str:
    return POINTS + f'outputs:\n  o: "{expression}"\n'


ERRORS = [
    (law("distance(p[i], p[i+1]) = 1"), "no-such-member", 6, "p[i+1]", "`p[5]` (first where i = 4)"),
    (law("p[i][i].x = 1"), "no-such-member", 6, "p[i][i].x", "1 index"),
    (law("p[i/2].x = 1"), "not-a-whole-number", 6, "i/2", "i = 1"),
    (law("p[h].x = 1"), "not-a-whole-number", 6, "h", "2.5"),
    (law("p[w].x = 1"), "not-a-whole-number", 6, "w", "vector"),
    (law("p[t].x = 1"), "unknown-name", 6, "t", "t"),
    (law("i.x = 0"), "not-a-vector", 6, "i.x", "scalar"),
    (law("p[i].x/(i - 3) = 0"), "not-finite", 6, "p[i].x/(i - 3)", "i = 3"),
    (law("p[i].x*10**(100*i) = 0"), "not-finite", 6, "10**(100*i)", "i = 4"),
    (output("p.x"), "family-needs-index", 6, "p", "family"),
    (output("norm(p)"), "family-needs-index", 6, "p", "family"),
    (output("p[9].x"), "no-such-member", 6, "p[9].x", "p[9]"),
    (output("i"), "unknown-name", 6, "i", "i"),
    (output("N[1]"), "not-a-family", 6, "N[1]", "parameter"),
    (output("t[1]"), "not-a-family", 6, "t[1]", "no family"),
    (output("p[1].q"), "unknown-component", 6, "p[1].q", ".q"),
    (output("p[9**99].x"), "not-a-whole-number", 6, "9**99", "2**53"),
    (output("p[1/0].x"), "not-finite", 6, "1/0", "zero"),
    (output("reaction(p)"), "family-needs-index", 6, "p", "family"),
    (law("p[i].x = i") + "outputs: {o: multiplier(l)}\n", "family-needs-index", 7, "l", "family"),
    (law("p[i].x = i") + 'outputs: {o: "multiplier(l[7])"}\n', "no-such-member", 7, "l[7]", "l[7]"),
    (law("p[i].x = i") + 'outputs: {o: "multiplier(l[1].x)"}\n', "unknown-constraint", 7, "l[1].x", "constraint"),
    (law("p[i].x = i") + '  l[2]: "p[1].y = 0"\n', "duplicate-name", 7, "l[2]", "`l[2]`"),
    (POINTS + '  p[j]: {for: "j = 3..6", mass: 1, position: [0, 0, 0]}\n', "duplicate-name", 5, "p[j]", "`p[3]`"),
    (POINTS + "  p: {mass: 1, position: [0, 0, 0]}\n", "duplicate-name", 5, "p", "already"),
    (POINTS + "coordinates:\n  p[9]: {}\n", "duplicate-name", 4, "p[i]", "coordinate"),
    (POINTS + "definitions: {i: 3}\n", "bad-range", 4, '"i = 1..N"', "definition"),
    (particle('p[1]: {for: "i = 1..3"'), "duplicate-name", 4, "p[1]", "`p[1]`"),
    (particle('p[i]: {for: "i = 1..K"'), "unknown-name", 4, "K", "K"),
    (particle('p[i]: {for: ["i = 1..j", "j = 1..2"]'), "unknown-name", 4, "j", "j"),
    (particle('p[i]: {for: ["i = 1..N", "i = 1..N"]'), "bad-range", 4, '"i = 1..N"', "two ranges"),
    (particle('p[N]: {for: "N = 1..3"'), "bad-range", 4, '"N = 1..3"', "parameter"),
    (particle('p[t]: {for: "t = 1..3"'), "bad-range", 4, '"t = 1..3"', "reserved"),
    (particle('t[i]: {for: "i = 1..3"'), "bad-name", 4, "t[i]", "reserved"),
    (particle('all[i]: {for: "i = 1..3"'), "bad-name", 4, "all[i]", "all"),
    (particle('p[i]: {for: "i = 1..3", if: "i = 2"'), "syntax", 4, "=", "compare"),
    (particle('p[i]: {for: "i = 1..3", if: [1]'), "bad-range", 4, "[1]", "condition"),
    (particle('p[1]: {if: "1 == 1"'), "bad-range", 4, '"1 == 1"', "no `for`"),
    (particle('p: {for: "i = 1..3"'), "bad-range", 4, "p", "indices"),
    (particle("p[i]: {for: []"), "bad-range", 4, "[]", "empty"),
    (particle('p[i]: {for: "i = 1..big*big"'), "too-many-members", 4, '"i = 1..big*big"', "1000000"),
    (particle('p[i][j]: {for: ["i = 1..big", "j = 1..big"]'), "too-many-members", 4, '"j = 1..big"', "1000000"),
    (particle('p[i]: {for: "i = 1..5"', "mass: 3 - i, position: [0, 0, 0]"), "mass-not-positive", 4, "3 - i", "i = 3"),
    (particle('p[i]: {for: "i = 1..5"', 'mass: 1, position: "[log(i), 1/i/0, 0]"'), "not-finite", 4, "1/i/0", "zero"),
    (POINTS + 'forces:\n  f[m]: {for: "m = 1..3", to: "p[m]", force: r}\n', "bad-range", 6, '"m = 1..3"', "own"),
    (POINTS + 'forces:\n  f[i]: {for: "i = 1..9", to: "p[i]", force: r}\n', "no-such-member", 6, "p[i]", "i = 5"),
    (ANGLES + '  p[i]: {for: "i = 1..N", mass: 1, position: "p[N+1-i]*q"}\n', "circular", 5, "p[N+1-i]*q", "`p[1]`"),
    (ANGLES + '  p[i]: {for: "i = 1..N", mass: 1, position: "p[i]*q"}\n', "circular", 5, "p[i]*q", "`p[1]`"),
    (ANGLES + '  p[i]: {for: "i = 1..N", mass: 1, position: "p[i-1]*q"}\n', "no-such-member", 5, "p[i-1]", "i = 1"),
    (law("i = 1"), "no-coordinates", 6, '"i = 1"', "`l[1]`"),
]  # fmt: skip


@pytest.mark.parametrize(("document", "code", "line", "spot", "word"), ERRORS)
def test_a_wrong_family_is_refused_at_its_template(
    document: str, code: str, line: int, spot: str, word: str
) -> None:
    with pytest.raises(lagcli.ModelError) as caught:
        system.build(lagcli.loads(document))
    (found,) = caught.value.diagnostics
    at = found.location
    shown = at.source_line[at.column - 1 : at.column - 1 + at.length]
    assert (found.code, at.line, shown) == (code, line, spot)
    assert word in found.message


def test_all_errors_of_a_file_of_families_come_in_one_go() -> None:
    text = law("p[i+1].x = 1") + '  k[i]: {for: "i = 1..K", equation: "p[i].x = 1"}\n'
    text += 'outputs:\n  o: "multiplier(k[1]) + multiplier(l[1])"\n  u: p\nrigid: {b: [p, "p[1]"]}\n'
    with pytest.raises(lagcli.ModelError) as caught:
        lagcli.loads(text)
    assert [(d.code, d.location.line) for d in caught.value.diagnostics] == [
        ("no-such-member", 6),
        ("unknown-name", 7),
        ("family-needs-index", 10),
        ("duplicate-name", 11),
    ]


NASTY = {
    "pairs of forces": particle('p[i]: {for: "i = 1..2000"') + "forces:\n"
    '  f[j]: {for: "j = 1..2000", to: p, force: [0, 0, 1]}\n',
    "far bounds": particle('p[i][j]: {for: ["i = 1..5000", "j = -2**53..2**53"]'),
    "a long filter": particle('p[i]: {for: "i = 1..100000", if: "' + " and ".join(["i != 3"] * 5000) + '"'),
    "a long formula": particle(
        'p[i]: {for: "i = 1..100000"', f'mass: "{"+".join(["i"] * 5000)}", position: [0, 0, 0]'
    ),
    "many ranges": particle(f"p: {{for: [{', '.join(f'i{k} = 1..2' for k in range(50))}]").replace(
        "p:", "p" + "".join(f"[i{k}]" for k in range(50)) + ":"
    ),
    "many indices": output("p" + "[1]" * 5000),
    "deep indices": output("p[" * 300 + "1" + "]" * 300),
    "deep parentheses": output("p[" + "(" * 3000 + "1" + ")" * 3000 + "]"),
    "a flood": POINTS + "outputs:\n" + "".join(f'  o{k}: "p[i+{k}].x"\n' for k in range(3000)),
}


@pytest.mark.parametrize("name", NASTY)
def test_a_hostile_family_is_refused_at_once(name: str) -> None:
    with at_most_calls(2_000_000), pytest.raises(lagcli.ModelError):
        lagcli.loads(NASTY[name])


pieces = st.sampled_from(
    [
        *"ipN[]()+-*/.,=<>!\"'{}: ",
        "p[i]",
        "..",
        "for",
        "if",
        "1",
        "9",
        "and",
        "not",
        "==",
        "i = 1..N",
        "p[",
        "x",
        "0",
    ]
)


@settings(max_examples=150, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.lists(pieces, max_size=12).map("".join), st.sampled_from(range(5)))
def test_any_text_in_a_family_gives_a_model_or_an_error(text: str, place: int) -> None:
    name, loop, condition, formula, target = ("p[i]", "i = 1..N", "i < 9", "[i, 0, 0]", "p[1]")
    written = [name, loop, condition, formula, target]
    written[place] = text
    name, loop, condition, formula, target = (part.replace("\\", "").replace('"', "") for part in written)
    document = f'{HEAD}particles:\n  "{name}": {{for: "{loop}", if: "{condition}", mass: 1, position: "{formula}"}}\n'
    document += f'forces:\n  f: {{to: "{target}", force: [0, 0, 1]}}\n'
    with contextlib.suppress(diagnostics.ModelError):
        lagcli.loads(document)


def test_a_hundred_thousand_members_are_read_in_a_moment() -> None:
    with at_most_calls(5_000_000):
        model = lagcli.loads(CHAIN.partition("outputs:")[0], {"N": 100_000})
    assert len(model.holonomic[2].rows) == 99_999


# -- changes -----------------------------------------------------------------------------------------------------


def starts(document: str, changes: Mapping[str, object]) -> list[Any]:
    return [part.tolist() for part in system.start(lagcli.loads(document, changes))]


def test_the_start_of_one_member_can_be_set() -> None:
    q, v = starts(POINTS, {"p[3].x": "N/2", "p[2].position": [1, 2, 3], "p[N].vy": 7, "p[1].velocity": "2*w"})
    assert q == [1, 0, 0, 1, 2, 3, 2, 0, 0, 4, 0, 0]
    assert v == [2, 4, 6, 0, 0, 0, 0, 0, 0, 0, 7, 0]
    assert starts(POINTS, {"p[i].position": "[0, i, h]"})[0][:6] == [0, 1, 2.5, 0, 2, 2.5]
    q, v = starts(MODELS["pendulum in angles"], {"a[2].value": 0.1, "a[N].rate": "L", "a[i].rate": "i"})
    assert (q, v) == ([0.4, 0.1, 0.6, 0.7, 0.8], [1, 2, 3, 4, 0.7])


@pytest.mark.parametrize(
    ("name", "value", "word"),
    [
        ("p[9].x", 1, "from `p[1]` to `p[4]`"),
        ("p[1][2].x", 1, "1 index"),
        ("p[1.5].x", 1, "whole"),
        ("p[j].x", 1, "`j`"),
        ("p[2].value", 1, "`p[2].position`"),
        ("p[2].mass", 1, "`p[2].position`"),
        ("p[2]", 1, "`p[2].position`"),
        ("p.x", 1, "`p[i].position`"),
        ("p[2].x", [1, 2], "number"),
        ("q[2].x", 1, "no parameter"),
        ("p[2.x", 1, "closed"),
    ],
)
def test_a_change_of_no_member_is_refused(name: str, value: object, word: str) -> None:
    with pytest.raises(overrides.OverrideError, match=re.escape(f"--set {name}: ")) as caught:
        lagcli.loads(POINTS, {name: value})
    assert word in str(caught.value)


@pytest.mark.parametrize(
    ("document", "name", "value", "code"),
    [
        (POINTS, "p[2].x", "i", "unknown-name"),
        (POINTS, "p[2].x", "t", "time-not-allowed"),
        (POINTS, "p[2].position", [1, 2], "vector-length"),
        (POINTS, "p[2].velocity", "1", "not-a-vector"),
        (POINTS, "p[i].position", "[j, 0, 0]", "unknown-name"),
        (MODELS["pendulum in angles"], "p[2].position", [0, 0, 0], "not-an-initial-value"),
    ],
)
def test_a_wrong_start_of_a_member_is_located(document: str, name: str, value: object, code: str) -> None:
    with pytest.raises(lagcli.ModelError) as caught:
        lagcli.loads(document, {name: value})
    (found,) = caught.value.diagnostics
    assert (found.code, found.location.path) == (code, f"--set {name}")


def test_runs_with_other_members_and_starts_do_not_get_into_each_other() -> None:
    def run(changes: Mapping[str, object]) -> Any:
        return lagcli.simulate(lagcli.loads(CHAIN, changes), duration=0.1, samples=3, assemble=True).rows

    # The last two have the same members; only one start differs.
    variants: list[dict[str, object]] = [
        {"N": 4}, {"N": 6}, {}, {"N": 2}, {"L": 0.7}, {"p[3].y": 0.1}, {"p[3].vz": 1}, {"N": 4, "p[2].z": 0.1}
    ]  # fmt: skip
    alone_found = []
    for changes in variants:
        memory.forget()
        alone_found.append(run(changes))
    memory.forget()
    for _ in range(2):
        for changes, expected in zip(variants, alone_found, strict=True):
            np.testing.assert_array_equal(run(changes), expected)
    assert len({rows.tobytes() for rows in alone_found}) == len(variants) - 1  # N: 6 is what the file says


@pytest.mark.parametrize("count", ["1", "2", "3", "8"])
def test_a_parameter_decides_how_many_members_there_are(count: str) -> None:
    chain = CHAIN.replace('  pull[k]: {for: "k = 1..N/2"', '  pull[k]: {for: "k = 1..1"')
    if count == "1":
        chain = chain.replace("multiplier(link[2]) + ", "").replace("reaction(p[2*k-1])", "reaction(p[k])")
    require_same(chain, {"N": count})


# -- verdicts ----------------------------------------------------------------------------------------------------

BLADES = """\
lagcli: 1
parameters: {N: 30, c: 2}
coordinates:
  x[i]: {for: "i = 1..N", value: "i"}
  y[i]: {for: "i = 1..N"}
  a[i]: {for: "i = 1..N", value: 1, rate: 1}
  t0: {}
lagrangian: rate(t0)**2
particles:
  p[i]: {for: "i = 1..N", mass: 1, position: "[x[i], y[i], a[i]]"}
differential:
  knife[i]: {for: "i = 1..N", equation: "sin(a[i])*d(x[i]) - cos(a[i])*d(y[i]) = 0"}
  roll[i]: {for: "i = 1..N", equation: "c*d(x[i]) + x[i]*d(a[i]) + t0*d(x[i])*0 = 0"}
  odd[i]: {for: "i = 1..3", equation: "i*d(x[i]) + x[1]*d(y[i]) = 0"}
"""


def test_equal_laws_are_judged_once_and_told_of_each(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    classify = frobenius.classify
    monkeypatch.setattr(
        frobenius, "classify", lambda form, deadline: asked.append(form.name) or classify(form, deadline)
    )
    verdicts = {c.name: c.verdict for c in lagcli.check(lagcli.loads(BLADES), limit=600).constraints}
    # The search for joint integrals asks about combinations of rows too, which have no name of their own.
    assert [name for name in asked if name in verdicts] == [
        "knife[1]",
        "roll[1]",
        "odd[1]",
        "odd[2]",
        "odd[3]",
    ]
    assert len(verdicts) == 63
    # Two forms in three coordinates: the knife is integrable together with the rolling.
    assert {verdicts[f"knife[{i}]"].kind for i in range(4, 31)} == {"jointly-integrable"}
    assert "(x[30], y[30], a[30])" in verdicts["knife[30]"].method
    first, last = verdicts["roll[1]"], verdicts["roll[29]"]
    assert (first.kind, last.kind) == ("integrable", "integrable")
    for one in ("integral", "integrating_factor"):
        assert getattr(last, one) == getattr(first, one).replace("[1]", "[29]")
    assert "x[29]" in str(last.integral)
