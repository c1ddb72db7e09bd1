"""The lines of `derive` about small oscillations: against equations worked out by hand, and the numbers of `modes`."""

from __future__ import annotations

import numpy as np
import pytest
import sympy
from scipy import linalg

import lagcli
from lagcli.api import cache, find_modes
from lagcli.derivation.sections import linear_section
from lagcli.derivation.sections.linear_section import TITLE
from lagcli.linearization import reference
from lagcli.linearization.linearized import LinearizedFunctions

HEAD = "lagcli: 1\n"
HANGING = """\
parameters: {m: 2, l: 0.75, g: 9.81, c: 0.3, k: 4}
particles:
  a: {mass: m, position: [0, 0, -0.75]}
  b: {mass: 1, position: [0, 0, -1.5]}
forces:
  weight: {to: all, force: "[0, 0, -m*g]"}
  drag: {to: b, force: "-c*v"}
  spring: {potential: k/2*a.x**2}
holonomic: {rod: norm(a) = l, link: "distance(a, b) = l"}
"""
# A bead that rests in a bowl that turns: gyroscopic terms, and follower forces that are no gradient.
TURNING = """\
parameters: {W: 0.5, k: 3, s: 0.2}
coordinates: {x: {}, y: {}}
lagrangian: (rate(x)**2 + rate(y)**2)/2 + W*(x*rate(y) - y*rate(x)) - k/2*(x**2 + 2*y**2)
forces: {across: {to: x, force: s*y}, back: {to: y, force: -s*x}}
"""
DISK = """\
parameters: {m: 2, r: 0.5, A: 0.125, J: 0.25, g: 9.81}
coordinates: {x: {rate: 1.75}, y: {}, heading: {}, lean: {}, roll: {rate: 3.5}}
lagrangian: >-
  m/2*(rate(x)**2 + (rate(y) + r*cos(lean)*rate(lean))**2) + A/2*(rate(lean)**2 + (rate(heading)*cos(lean))**2)
  + J/2*(rate(roll) + rate(heading)*sin(lean))**2 - m*g*r*cos(lean)
differential: {x_row: rate(x) = r*cos(heading)*rate(roll), y_row: rate(y) = r*sin(heading)*rate(roll)}
"""
SPUN = """\
parameters: {m: 1, L: 1, w: 2}
coordinates: {phi: {rate: w}, u: {value: 1}}
particles: {a: {mass: m, position: "[u*cos(phi), u*sin(phi), 0]"}}
holonomic: {rod: u = L}
"""
RESTING = """\
particles: {a: {mass: 2, position: [0, 0, 0.5]}}
forces: {weight: {to: a, force: [0, 0, -9.81*2]}, spring: {potential: a.x**2 + a.x*a.y + a.y**2}}
inequality: {floor: a.z - a.x**2/3 >= 0.5}
"""
MODELS = {"hanging": HANGING, "turning": TURNING, "disk": DISK, "spun": SPUN, "resting": RESTING}


def section(text: str) -> list[dict[str, str]]:
    return [line for line in lagcli.derive(lagcli.loads(HEAD + text)).as_json() if line["section"] == TITLE]


def equations(text: str) -> list[tuple[str, str]]:
    return [(line["left"], line["right"]) for line in section(text) if line["left"]]


def notes(text: str) -> str:
    return " ".join(line["note"] for line in section(text))


def numbers(text: str) -> dict[str, np.ndarray]:
    """The symbolic matrices with the values of parameters and of the start put in."""
    model = lagcli.loads(HEAD + text)
    point = find_modes.of_start(model)
    assert point.kind != "general"
    assert not point.reason
    page = lagcli.derive(model)
    system = page.system.closed(point.closed)
    found = linear_section.matrices(system, point)
    put: dict[sympy.Symbol, float] = dict(page.system.table.parameter_values)
    for letters, values in zip((system.q, system.v, system.a, system.lam), point.numbers, strict=True):
        put |= dict(zip(letters, values, strict=True))
    n, rows = len(system.q), len(system.rows)
    shapes = {"M": (n, n), "C": (n, n), "K": (n, n), "B": (rows, n), "D": (rows, n)}
    dense = {}
    for name, shape in shapes.items():
        dense[name] = np.zeros(shape)
        for place, value in found[name].items():
            dense[name][place] = float(system.table.calculus.expanded(value).subs(put))
    return dense


@pytest.mark.parametrize("name", MODELS)
def test_the_matrices_are_those_of_modes(name: str) -> None:
    model = lagcli.loads(HEAD + MODELS[name])
    ready = cache.compiled(model)
    here, closed, _ = find_modes.start(ready, 1.0)
    there = reference.classified(LinearizedFunctions(ready.system, closed), ready.numeric, here, 1.0)
    assert there is not None
    linear, whole = there.linear, ready.system.holonomic_count
    found = numbers(MODELS[name])
    for part in ("M", "C", "K"):
        wanted = getattr(linear, part).toarray()
        np.testing.assert_allclose(found[part], wanted, rtol=0, atol=1e-11 * np.abs(linear.K.toarray()).max())
    B, A = linear.B.toarray(), linear.A.toarray()
    np.testing.assert_allclose(found["B"], np.vstack([B[:whole], A, B[whole:]]), rtol=0, atol=1e-13)
    np.testing.assert_allclose(found["D"][whole : whole + len(A)], linear.D.toarray(), rtol=0, atol=1e-13)


@pytest.mark.parametrize("name", ["hanging", "turning", "resting"])
def test_their_eigenvalues_are_those_of_modes(name: str) -> None:
    found = numbers(MODELS[name])
    n = len(found["M"])
    N = linalg.null_space(found["B"]) if len(found["B"]) else np.eye(n)
    M, C, K = (N.T @ found[part] @ N for part in "MCK")
    free, one = np.zeros_like(M), np.eye(len(M))
    wanted = linalg.eigvals(np.block([[free, one], [-linalg.solve(M, K), -linalg.solve(M, C)]]))
    modes = lagcli.modes(lagcli.loads(HEAD + MODELS[name])).eigenvalues
    assert modes.size == wanted.size
    for z in wanted:
        assert np.abs(modes - z).min() < 1e-9 * np.abs(wanted).max()


def test_turning_bowl_by_hand() -> None:
    """x'' - 2 W y' + k x - s y = 0, y'' + 2 W x' + 2 k y + s x = 0."""
    assert equations(TURNING) == [
        ("δẍ − 2 W δẏ + k δx − s δy", "0"),
        ("δÿ + 2 W δẋ + s δx + 2 k δy", "0"),
    ]


def test_rod_that_hangs_by_hand() -> None:
    """About (0, 0, -L): m x'' + lambda x/L = 0, m z'' = dlambda, dz = 0; lambda = -m g is in K."""
    found = equations(
        "parameters: {m: 2, L: 1, g: 9.81}\nparticles: {a: {mass: m, position: [0, 0, -1]}}\n"
        "forces: {weight: {to: a, force: '[0, 0, -m*g]'}}\nholonomic: {rod: L = norm(a)}\n"
    )
    assert found == [
        ("m δẍ_a + λ_rod δx_a/L", "0"),
        ("m δÿ_a + λ_rod δy_a/L", "0"),
        ("m δz̈_a + (λ_rod/L − λ_rod z_a²/L³) δz_a", "−z_a δλ_rod/L"),
        ("−z_a δz_a/L", "0"),
        ("z_a", "−1"),
        ("λ_rod", "19.62"),
    ]


def test_about_any_point_of_rest_where_the_start_is_none() -> None:
    text = (
        "parameters: {m: 2, L: 1, g: 9.81}\ncoordinates: {theta: {value: 0.5}}\n"
        "particles: {a: {mass: m, position: '[L*sin(theta), 0, -L*cos(theta)]'}}\n"
        "forces: {weight: {to: a, force: '[0, 0, -m*g]'}}\n"
    )
    assert equations(text) == [("m L² δθ̈ + m g L cos θ δθ", "0")]
    assert "no equilibrium" in notes(text)
    page = lagcli.derive(lagcli.loads(HEAD + text))
    assert r"\delta \ddot{\theta}" in page.latex()
    assert '<mrow><mi>δ</mi><mover accent="true"><mi>θ</mi><mo>¨</mo></mover></mrow>' in page.html()
    assert "m L² δθ̈ + m g L cos θ δθ = 0" in page.text()


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (
            "coordinates: {x: {}}\nlagrangian: rate(x)**2/2 - (2 + cos(t))*x**2/2\n",
            "about the declared start depend on t",
        ),
        (
            "coordinates: {x: {value: 1}}\nlagrangian: rate(x)**2/2 - (2 + cos(t))*x**2/2\n",
            "the linear equations depend on t",
        ),
        ("coordinates: {x: {}}\nlagrangian: rate(x)**2/2 - x*abs(x)\n", "an abs, sign, min, max or step"),
        (
            "particles: {'p[i]': {for: i = 1..11, mass: 1, position: [i, 0, 0]}}\n",
            "there are 33 coordinates",
        ),
        (
            "particles: {a: {mass: 1, position: [0, 0, 0], velocity: [1, 0, 1]}}\n"
            "forces: {drag: {to: a, force: -v}}\nholonomic: {w: a.x = sin(t)}\n",
            "the row w moves",
        ),
    ],
)
def test_what_is_not_written_is_said_with_its_reason(text: str, reason: str) -> None:
    assert not equations(text)
    assert reason in notes(text)
