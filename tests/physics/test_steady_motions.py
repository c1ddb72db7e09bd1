"""Steady motions in units of many sizes against closed forms, and starts that are none."""

from __future__ import annotations

import json
import pathlib

import numpy as np
import pytest
from scipy import linalg

import lagcli
from lagcli.analysis.classification import classify
from lagcli.analysis.classification.verdict import KnownIntegrals
from lagcli.api import find_modes
from lagcli.api.find_modes import NoEquilibriumError
from lagcli.linearization.linearized import LinearizedFunctions
from tests.helpers import in_process, whipple

g, S, C = 9.81, np.sin(0.7), np.cos(0.7)

# Name: coordinates and laws, and w in units of 1/T for a speed W in these units; L, T and m are units of length, time
# and mass, and g is 9.81 L/T^2.
MOTIONS = {
    "conical pendulum in angles": (
        """
coordinates: {th: {value: a}, ph: {rate: sqrt(g/L/cos(a))}}
lagrangian: m*L**2*(rate(th)**2 + sin(th)**2*rate(ph)**2)/2 + m*g*L*cos(th)
""",
        lambda W: [0, np.sqrt(g / C * (1 + 3 * C**2))],
    ),
    "conical pendulum with the row of its rod": (
        """
coordinates: {r: {value: L*sin(a)}, z: {value: -L*cos(a)}, ph: {rate: sqrt(g/L/cos(a))}}
lagrangian: m*(rate(r)**2 + rate(z)**2 + r**2*rate(ph)**2)/2 - m*g*z
holonomic: {rod: sqrt(r**2 + z**2) = L}
""",
        lambda W: [0, np.sqrt(g / C * (1 + 3 * C**2))],
    ),
    "top that precesses": (
        """
parameters: {A: m*L**2, Cz: 0.6*A, Om: W/T, spin: (m*g*L + A*Om**2*cos(a))/Om}
coordinates: {th: {value: a}, ph: {rate: Om}, ps: {rate: spin/Cz - Om*cos(a)}}
lagrangian: >-
  A/2*(rate(th)**2 + sin(th)**2*rate(ph)**2) + Cz/2*(rate(ps) + cos(th)*rate(ph))**2 - m*g*L*cos(th)
""",
        lambda W: [
            0,
            0,
            np.sqrt((g / W + W * C) ** 2 - 4 * (g / W + W * C) * W * C + W**2 * (1 + 3 * C**2)),
        ],
    ),
    "bead on a hoop that is turned": (
        """
parameters: {Om: sqrt(g/L/cos(a))}
coordinates: {th: {value: a}, ph: {rate: Om}}
lagrangian: m*L**2*(rate(th)**2 + sin(th)**2*rate(ph)**2)/2 + m*g*L*cos(th)
holonomic: {drive: ph = Om*t}
""",
        lambda W: [np.sqrt(g / C) * S],
    ),
    "governor": (
        """
parameters: {k: 0.4*W, Om: sqrt(g/L/cos(a))}
coordinates: {th: {value: a}, ph: {rate: Om}}
lagrangian: m*L**2*(rate(th)**2 + (sin(th)**2 + k)*rate(ph)**2) + 2*m*g*L*cos(th)
""",
        lambda W: [0, np.sqrt(g / C * (S**2 + 4 * S**2 * C**2 / (S**2 + 0.4 * W)))],
    ),
    "satellite": (
        """
coordinates: {r: {value: W*L}, ph: {rate: sqrt(mu/r0**3)}, z: {}}
parameters: {mu: 3*L**3/T**2, r0: W*L}
lagrangian: m*(rate(r)**2 + r**2*rate(ph)**2 + rate(z)**2)/2 + m*mu/sqrt(r**2 + z**2)
""",
        lambda W: [0, np.sqrt(3 / W**3), np.sqrt(3 / W**3)],
    ),
    "particle in a bowl": (
        """
coordinates: {r: {value: W*L}, z: {value: W**2*L/2}, ph: {rate: sqrt(g/L)}}
lagrangian: m*(rate(r)**2 + rate(z)**2 + r**2*rate(ph)**2)/2 - m*g*z
holonomic: {bowl: z = r**2/(2*L)}
""",
        lambda W: [0, np.sqrt(4 * g / (1 + W**2))],
    ),
    "particle in a funnel": (
        """
coordinates: {r: {value: L}, z: {value: W*L}, ph: {rate: sqrt(g*W/L)}}
lagrangian: m*(rate(r)**2 + rate(z)**2 + r**2*rate(ph)**2)/2 - m*g*z
holonomic: {funnel: z = W*r}
""",
        lambda W: [0, np.sqrt(3 * g * W / (1 + W**2))],
    ),
    "particle on a table with a weight below": (
        """
coordinates: {r: {value: L}, z: {value: -L}, ph: {rate: sqrt(W*g/L)}}
lagrangian: m*(rate(r)**2 + r**2*rate(ph)**2)/2 + W*m*rate(z)**2/2 - W*m*g*z
holonomic: {thread: r - z = 2*L}
""",
        lambda W: [0, np.sqrt(3 * W * g / (1 + W))],
    ),
    "mass on a spring that turns": (
        """
parameters: {k: 30*m/T**2, Om: W/T}
coordinates: {r: {value: k*L/(k - m*Om**2)}, ph: {rate: Om}}
lagrangian: m/2*(rate(r)**2 + r**2*rate(ph)**2) - k/2*(r - L)**2
""",
        lambda W: [0, np.sqrt(30 + 3 * W**2)],
    ),
    "charge in a magnetic field": (
        """
coordinates: {r: {value: L}, ph: {rate: -W/T}}
lagrangian: m/2*(rate(r)**2 + r**2*rate(ph)**2) + m*W/T/2*r**2*rate(ph)
""",
        lambda W: [0, W],
    ),
    "disk that rolls": (
        """
parameters: {I: 0.25*m*L**2, J: 0.5*m*L**2, s: 5*W/T}
coordinates: {x: {rate: L*s}, y: {}, ph: {}, th: {}, ps: {rate: s}}
lagrangian: >-
  m/2*((rate(x) - L*cos(th)*sin(ph)*rate(th) - L*sin(th)*cos(ph)*rate(ph))**2
  + (rate(y) + L*cos(th)*cos(ph)*rate(th) - L*sin(th)*sin(ph)*rate(ph))**2 + L**2*sin(th)**2*rate(th)**2)
  + I/2*(rate(th)**2 + cos(th)**2*rate(ph)**2) + J/2*(rate(ps) - sin(th)*rate(ph))**2 - m*g*L*cos(th)
differential: {roll_x: rate(x) = L*cos(ph)*rate(ps), roll_y: rate(y) = L*sin(ph)*rate(ps)}
""",
        lambda W: [0, 0, 0, 0, np.sqrt((3 * 25 * W**2 - g) / 1.25)],
    ),
    "sleigh that leads its blade": (
        """
coordinates: {x: {rate: W*L/T}, y: {}, th: {}}
lagrangian: >-
  m/2*((rate(x) - L*sin(th)*rate(th))**2 + (rate(y) + L*cos(th)*rate(th))**2) + m*L**2*rate(th)**2/4
differential: {blade: rate(y)*cos(th) = rate(x)*sin(th)}
""",
        lambda W: [-W / 1.5],
    ),
}
UNITS = [(1.0, 1.0, 1.0), (1e-6, 1e-3, 1e6), (1e6, 1e3, 1e-6)]


@pytest.mark.parametrize("name", MOTIONS)
def test_a_steady_motion_is_one_in_any_units_and_at_any_speed(name: str) -> None:
    laws, wanted = MOTIONS[name]
    head, *rest = laws.split("parameters: {") if "parameters" in laws else (laws, "")
    known, _, after = rest[0].partition("}")
    for speed in (0.7, 1.6):
        for L, T, m in UNITS:
            text = (
                f"lagcli: 1\nparameters: {{L: {L}, T: {T}, m: {m}, W: {speed}, a: 0.7, g: 9.81*L/T**2, {known}}}"
                f"{head}{after}simulation: {{duration: {10 * T}}}\n"
            )
            found = lagcli.modes(lagcli.loads(text))
            assert found.about == "steady", (speed, L, T, m)
            if found.frequencies is None:
                real = found.eigenvalues[found.eigenvalues != 0] * T
                np.testing.assert_allclose(real, wanted(speed), rtol=1e-9)
            else:
                np.testing.assert_allclose(found.frequencies * T, wanted(speed), rtol=1e-9)


def test_the_bicycle_has_its_published_eigenvalues_at_every_speed(monkeypatch: pytest.MonkeyPatch) -> None:
    """At v = 3 and 6 the projected start has a rate of 1e-33 in one row, which is all there is in that row."""
    built: list[LinearizedFunctions] = []

    def functions(linearizing, closed) -> LinearizedFunctions:
        built.append(built[0] if built else LinearizedFunctions(linearizing.ready.system, closed))
        return built[0]

    # None of its rows can be integrated, and its functions are those of every speed.
    monkeypatch.setattr(classify, "search", lambda *given: KnownIntegrals())
    monkeypatch.setattr(find_modes._Linearizing, "_functions", functions)
    for v in (0.1, 3, 6, 13.7):
        found = lagcli.modes(lagcli.loads(whipple.MODEL, parameters={"v": v}))
        wanted = whipple.eigenvalues(v)
        assert found.about == "steady", v
        assert np.count_nonzero(found.eigenvalues) == 4
        for z in wanted:
            assert np.abs(found.eigenvalues - z).min() < 1e-11 * max(1, abs(z)), v
        assert found.growth == pytest.approx(max(0, wanted.real.max()), rel=1e-10)


@pytest.mark.parametrize("k", [1.0, 1e9, 1e11])
def test_a_spring_that_beats_is_seen_beside_one_that_is_far_stiffer(k: float) -> None:
    """x'' + (1.3 + 0.4 cos 2e5 t) x = 0, beside which 0.4 is a part of 1e-9 of the largest stiffness."""
    found = lagcli.modes(
        lagcli.loads(f"""
lagcli: 1
coordinates: {{x: {{}}, y: {{}}}}
lagrangian: (rate(x)**2 + rate(y)**2)/2 - (1.3 + 0.4*cos(2e5*t))*x**2/2 - {k}*y**2/2
simulation: {{duration: 0.0002}}
""")
    )
    assert found.about == "periodic"
    assert found.period == pytest.approx(np.pi / 1e5, rel=1e-9)


@pytest.mark.parametrize("ratio", [1.0, 1e3, 1e6])
def test_a_light_pendulum_that_is_let_go_is_no_equilibrium_beside_a_heavy_one_that_hangs(
    ratio: float,
) -> None:
    """The force on the light one is a part of 1e-12 of that on the heavy one, and moves it all the same."""
    text = f"""
lagcli: 1
particles: {{a: {{mass: {ratio}, position: [0, 0, -1]}}, b: {{mass: {1 / ratio}, position: [5.6, 0, -0.8]}}}}
forces: {{weight: {{to: all, force: [0, 0, -9.81*m]}}}}
holonomic: {{long: norm(a) = 1, short: "norm(b - [5, 0, 0]) = 1"}}
simulation: {{duration: 5}}
"""
    found = lagcli.modes(lagcli.loads(text), about="start")
    assert found.about == "periodic"
    assert found.period == pytest.approx(2.0605, rel=1e-3)  # that of a swing of 0.6435


def test_the_equilibrium_next_to_a_heavy_and_a_light_pendulum_is_one_of_both() -> None:
    found = lagcli.modes(
        lagcli.loads("""
lagcli: 1
particles: {a: {mass: 1e6, position: [0.6, 0, -0.8]}, b: {mass: 1e-6, position: [5.6, 0, -0.8]}}
forces: {weight: {to: all, force: [0, 0, -9.81*m]}}
holonomic: {long: norm(a) = 1, short: "norm(b - [5, 0, 0]) = 1", p: a.y = 0, r: b.y = 0}
""")
    )
    assert (found.at["a.z"], found.at["b.z"]) == pytest.approx((-1, -1), abs=1e-12)
    np.testing.assert_allclose(found.frequencies, [9.81**0.5] * 2, rtol=1e-9)


@pytest.mark.parametrize("x", [0, 1e-6, 1e-9, 1e-11, 1e-13, 1e-20])
def test_the_place_of_the_origin_makes_no_frequency_vanish(x: float) -> None:
    """A pendulum that hangs at the origin: the size of its coordinates is not that of its motion."""
    found = lagcli.modes(
        lagcli.loads(f"""
lagcli: 1
particles: {{p: {{mass: 1, position: [{x}, 0, 0]}}}}
forces: {{weight: {{to: p, force: [0, 0, -9.81*m]}}}}
holonomic: {{rod: "distance(p, [0, 0, 1]) = 1"}}
simulation: {{assemble: true}}
""")
    )
    np.testing.assert_allclose(found.frequencies, [9.81**0.5] * 2, rtol=1e-10)
    assert found.stable is True


@pytest.mark.parametrize(("R", "w2"), [(0.7, 9.81), (6e-7, 5.29), (4.3e5, 7.013)])
def test_a_stiffness_that_is_rounding_is_none(R: float, w2: float) -> None:
    """A bead at the bottom of a hoop that turns at the critical speed, w^2 = g/R: there V = g R th^4/8 + ..."""
    found = lagcli.modes(
        lagcli.loads(f"""
lagcli: 1
parameters: {{R: {R}, w: sqrt({w2}/R), g: {w2}}}
coordinates: {{th: {{}}}}
lagrangian: R**2*(rate(th)**2 + w**2*sin(th)**2)/2 + g*R*cos(th)
""")
    )
    assert found.frequencies.tolist() == [0]
    assert found.stable is True


def test_a_drag_beside_a_far_larger_force_is_no_force_that_keeps_energy() -> None:
    text = """
lagcli: 1
coordinates: {x: {}, y: {}}
lagrangian: (rate(x)**2 + rate(y)**2)/2 - 1e12*x**2/2 - y**2/2
forces: {drag: {to: y, force: -1e-3*rate(y)**3}}
"""
    found = lagcli.modes(lagcli.loads(text))
    assert found.stable is None
    assert lagcli.modes(lagcli.loads(text.replace("1e-3*", "0*"))).stable is True


def random_system(seed: int) -> tuple[str, np.ndarray]:
    """A model with an equilibrium at a known point, coordinates in many units, and its eigenvalues but for zeros.

    The potential has the slope sum lambda_i grad f_i there, so that K = d2V - sum lambda_i d2f_i.
    """
    random = np.random.default_rng(seed)
    n, holonomic, differential = 4, int(random.integers(0, 3)), int(random.integers(0, 2))
    size, q0 = 10.0 ** random.uniform(-4, 4, n), random.normal(size=n)
    root, H, turn, drag = (random.normal(size=(n, n)) for _ in range(4))
    M, H, turn = root @ root.T + np.eye(n), H + H.T, turn - turn.T
    drag = drag @ drag.T * float(random.integers(0, 2)) / 5
    B, lam = random.normal(size=(holonomic, n)), random.normal(size=holonomic)
    bend = [random.normal(size=(n, n)) for _ in range(holonomic)]
    bend = [part + part.T for part in bend]
    A = random.normal(size=(differential, n))
    d = [f"(q{i}/{size[i]!r} - {q0[i]!r})" for i in range(n)]
    v = [f"(rate(q{i})/{size[i]!r})" for i in range(n)]

    def form(matrix: np.ndarray, left: list[str], right: list[str]) -> str:
        return " + ".join(
            f"({matrix[i, j]!r})*{left[i]}*{right[j]}" for i in range(n) for j in range(n) if matrix[i, j]
        )

    def line(row: np.ndarray, terms: list[str]) -> str:
        return " + ".join(f"({x!r})*{term}" for x, term in zip(row, terms, strict=True))

    slope = line(lam @ B, d) if holonomic else "0"
    rows = [f"  f{i}: {line(B[i], d)} + ({form(bend[i], d, d)})/2 = 0" for i in range(holonomic)]
    # Curved by d0 d1 dq2: none of them can be integrated.
    knives = [f"  k{i}: {line(A[i], v)} + {d[0]}*{v[1]} = 0" for i in range(differential)]
    forces = [
        f"  drag{i}: {{to: q{i}, force: -({line(drag[i], v)})/{size[i]!r}}}" for i in range(n) if drag.any()
    ]
    text = "\n".join(
        [
            "lagcli: 1",
            "coordinates:",
            *(f"  q{i}: {{value: {q0[i] * size[i]!r}}}" for i in range(n)),
            "lagrangian: >-",
            f"  ({form(M, v, v)})/2 - ({form(H, d, d)})/2 - ({slope})",
            f"  + ({form(turn, d, v)})/2 + {d[0]}**3",
            *(["forces:", *forces] if forces else []),
            *(["holonomic:", *rows] if rows else []),
            *(["differential:", *knives] if knives else []),
            "simulation: {assemble: true}",
        ]
    )
    K = H - sum((x * part for x, part in zip(lam, bend, strict=True)), np.zeros((n, n)))
    Z = linalg.null_space(B) if holonomic else np.eye(n)
    N = linalg.null_space(A @ Z) if differential else np.eye(Z.shape[1])
    mass, damping = N.T @ Z.T @ M @ Z @ N, N.T @ Z.T @ (drag - turn) @ Z @ N
    k, m = N.shape[1], Z.shape[1]
    S = np.zeros((m + k, m + k))
    S[:m, m:], S[m:, :m] = N, -np.linalg.solve(mass, N.T @ Z.T @ K @ Z)
    S[m:, m:] = -np.linalg.solve(mass, damping)
    values = np.linalg.eigvals(S)
    return text.replace("np.float64", ""), values[np.abs(values) > 1e-6]


@pytest.mark.parametrize("seed", [0, 2, 4, 10])
def test_random_systems_have_the_eigenvalues_of_their_own_linear_equations(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    text, wanted = random_system(seed)
    monkeypatch.setattr(classify, "search", lambda *given: KnownIntegrals())
    found = lagcli.modes(lagcli.loads(text), about="start")
    assert found.about == "equilibrium"
    values = found.eigenvalues[found.eigenvalues != 0]
    assert values.size == wanted.size
    for z in wanted:
        assert np.abs(values - z).min() < 1e-8 * np.abs(wanted).max()


MOVING = """
lagcli: 1
coordinates: {th: {value: 0.4, rate: 1}}
lagrangian: rate(th)**2/2 + 9.81*cos(th)
"""


def test_a_start_that_moves_is_refused_with_the_line_that_asks_for_another_answer(
    tmp_path: pathlib.Path,
) -> None:
    path = tmp_path / "swing.yaml"
    path.write_text(MOVING)
    out, err, code = in_process.run("modes", path, "--json")
    assert (out, code) == ("", 4)
    for about, kind in (("equilibrium", "equilibrium"), ("start", "periodic")):
        assert f"`lagcli modes {path} --about {about}`" in err
        out, _, code = in_process.run("modes", path, "--about", about, "--json")
        assert code == 0
        assert json.loads(out)["about"] == kind


def test_a_start_at_rest_that_is_no_equilibrium_gives_way_to_one_and_says_so() -> None:
    found = lagcli.modes(lagcli.loads(MOVING.replace("rate: 1", "rate: 0")))
    assert (found.about, found.at["th"]) == ("equilibrium", pytest.approx(0, abs=1e-12))
    assert (
        "at rest but is no equilibrium: these are the modes about the nearest equilibrium" in found.notes[0]
    )


def test_a_moving_start_beside_a_contact_that_presses_is_refused() -> None:
    """A bead that slides in a bowl on its floor; following is not offered where contacts press."""
    with pytest.raises(NoEquilibriumError) as refused:
        lagcli.modes(
            lagcli.loads("""
lagcli: 1
particles: {a: {mass: 1, position: [0.5, 0, 0.125], velocity: [0.2, 0, 0.1]}}
forces: {weight: {to: a, force: [0, 0, -9.81*m]}}
inequality: {bowl: a.z >= (a.x**2 + a.y**2)/2}
""")
        )
    assert "--about equilibrium" in str(refused.value)
    assert "--about start" not in str(refused.value)


def test_free_fall_is_told_to_be_accelerated() -> None:
    falling = "lagcli: 1\ncoordinates: {x: {rate: 2}, z: {value: 5}}\nlagrangian: rate(x)**2 + rate(z)**2 - 9.81*z\n"
    (note,) = lagcli.modes(lagcli.loads(falling)).notes
    assert "uniformly accelerated: no steady motion" in note
    assert "uniformly accelerated" in lagcli.derive(lagcli.loads(falling)).text()
    (note,) = lagcli.modes(lagcli.loads(falling.replace(" - 9.81*z", ""))).notes
    assert note == "about the declared start, an instant of a steady motion"


def test_integrals_of_rows_are_searched_for_once(monkeypatch: pytest.MonkeyPatch) -> None:
    laws = MOTIONS["disk that rolls"][0].replace(
        "parameters: {", "parameters: {L: 1, T: 1, m: 1, W: 1, g: 9.81, "
    )
    searches, search = [], classify._searched

    def counted(*given):
        searches.append(given)
        return search(*given)

    monkeypatch.setattr(classify, "_searched", counted)
    assert lagcli.modes(lagcli.loads(f"lagcli: 1{laws}")).about == "steady"
    assert len(searches) == 1
