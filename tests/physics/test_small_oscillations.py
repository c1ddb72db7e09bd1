"""Small oscillations against closed forms and published numbers."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import lagcli
from lagcli.api.find_modes import NoEquilibriumError

TWO_PENDULUMS = """\
lagcli: 1
parameters: {g: 9.81}
coordinates: {th1: {value: 0}, th2: {value: 0}}
particles:
  p1: {mass: 1, position: ["sin(th1)", 0, "-cos(th1)"]}
  p2: {mass: 1, position: ["sin(th1) + sin(th2)", 0, "-cos(th1) - cos(th2)"]}
forces: {weight: {to: all, force: [0, 0, -m*g]}}
"""
BOWL = """\
lagcli: 1
parameters: {a: 0.8, b: 2.1, c: 0.3, g: 9.81}
particles: {p: {mass: 1.7, position: [0, 0, 0]}}
forces: {weight: {to: all, force: [0, 0, -m*g]}}
holonomic: {bowl: p.z = a*p.x**2/2 + c*p.x*p.y + b*p.y**2/2}
"""
STRETCH = """\
lagcli: 1
parameters: {mO: 15.9994, mC: 12.011, k: 1.42, l: 1.162}
particles:
  O1: {mass: mO, position: [-l, 0, 0]}
  C: {mass: mC, position: [0, 0, 0]}
  O2: {mass: mO, position: [l, 0, 0]}
forces:
  s1: {potential: "k/2*(distance(O1, C) - l)**2"}
  s2: {potential: "k/2*(distance(C, O2) - l)**2"}
"""
FOUCAULT = """\
lagcli: 1
parameters: {w0: 3.1, W: 0.4, k: w0**2}
coordinates: {x: {value: 0}, y: {value: 0}}
lagrangian: (rate(x)**2 + rate(y)**2)/2 + W*(x*rate(y) - y*rate(x)) - k*(x**2 + y**2)/2
"""
DISK = """\
lagcli: 1
parameters: {m: 1.5, r: 0.4, I: 0.06, J: 0.12, g: 9.81, W: 2.5}
coordinates:
  x: {value: 0, rate: r*W}
  y: {value: 0, rate: 0}
  ph: {value: 0, rate: 0}
  th: {value: 0, rate: 0}
  ps: {value: 0, rate: W}
lagrangian: >-
  m/2*((rate(x) - r*cos(th)*sin(ph)*rate(th) - r*sin(th)*cos(ph)*rate(ph))**2
  + (rate(y) + r*cos(th)*cos(ph)*rate(th) - r*sin(th)*sin(ph)*rate(ph))**2 + r**2*sin(th)**2*rate(th)**2)
  + I/2*(rate(th)**2 + cos(th)**2*rate(ph)**2) + J/2*(rate(ps) - sin(th)*rate(ph))**2 - m*g*r*cos(th)
differential:
  roll_x: rate(x) = r*cos(ph)*rate(ps)
  roll_y: rate(y) = r*sin(ph)*rate(ps)
"""


def chain(n: int, length: float) -> str:
    """A chain of n rods that hangs straight down from the origin."""
    names = [f"p{k + 1}" for k in range(n)]
    places = [f"  {p}: {{mass: 1, position: [0, 0, {-(k + 1) * length!r}]}}" for k, p in enumerate(names)]
    rods = [f"  l1: norm(p1) = {length!r}"]
    rods += [
        f"  l{k + 2}: distance({a}, {b}) = {length!r}" for k, (a, b) in enumerate(itertools.pairwise(names))
    ]
    head = ["lagcli: 1", "parameters: {g: 9.81}", "particles:", *places]
    return "\n".join([*head, "forces: {weight: {to: all, force: [0, 0, -m*g]}}", "holonomic:", *rods]) + "\n"


def modes(text: str, **parameters: float) -> lagcli.Modes:
    return lagcli.modes(lagcli.loads(text, parameters=parameters))


def laguerre(n: int, length: float) -> np.ndarray:
    """w of n equal masses on equal links: w^2 = (g/l) x with x the zeros of the Laguerre polynomial L_n."""
    roots = np.polynomial.laguerre.lagroots([0] * n + [1])
    return np.sqrt(9.81 / length * np.sort(roots.real))


def test_two_pendulums_swing_together_and_against_each_other() -> None:
    found = modes(TWO_PENDULUMS)
    assert found.about == "equilibrium"
    assert found.coordinates == ("th1", "th2")
    np.testing.assert_allclose(found.frequencies, laguerre(2, 1.0), rtol=1e-12)
    half = 0.5**0.5
    np.testing.assert_allclose(found.shapes, [[half, 1], [-half, 1]], atol=1e-12)
    assert found.stable is True
    assert "minimum" in found.reason


def test_a_chain_in_space_has_each_frequency_in_two_planes_from_the_tension_of_its_rods_alone() -> None:
    found = modes(chain(8, 0.25))
    np.testing.assert_allclose(found.frequencies, np.repeat(laguerre(8, 0.25), 2), rtol=1e-11)
    # The two shapes of a frequency lie in the planes of the axes.
    assert all(np.count_nonzero(shape) == 8 for shape in found.shapes)


def test_a_redundant_row_changes_no_frequency() -> None:
    twice = modes(chain(3, 0.5) + "  again: 2*norm(p1) = 1\n")
    np.testing.assert_allclose(twice.frequencies, np.repeat(laguerre(3, 0.5), 2), rtol=1e-11)


def test_a_bowl_has_its_principal_curvatures() -> None:
    curvatures = np.linalg.eigvalsh([[0.8, 0.3], [0.3, 2.1]])
    np.testing.assert_allclose(modes(BOWL).frequencies, np.sqrt(9.81 * curvatures), rtol=1e-13)


def test_carbon_dioxide_stretches_in_two_ways_and_is_free_in_seven() -> None:
    """Landau and Lifshitz, Mechanics, par. 24; without bending stiffness both bends are free."""
    found = modes(STRETCH)
    m_O, m_C, k = 15.9994, 12.011, 1.42
    assert not found.frequencies[:7].any()
    np.testing.assert_allclose(
        found.frequencies[7:], [np.sqrt(k / m_O), np.sqrt(k * (1 / m_O + 2 / m_C))], rtol=1e-12
    )
    assert len(found.eigenvalues) == 18
    assert found.stable is None


def test_a_gyroscopic_term_parts_two_equal_frequencies() -> None:
    found = modes(FOUCAULT)
    root = np.hypot(3.1, 0.4)
    np.testing.assert_allclose(found.frequencies, [root - 0.4, root + 0.4], rtol=1e-14)
    np.testing.assert_allclose(found.shapes, [[1, -1j], [1, 1j]], atol=1e-12)
    assert found.stable is True
    assert found.as_json()["shapes"][0] == [[1.0, 0.0], [0.0, -1.0]]


def test_a_maximum_stabilized_by_gyroscopic_terms_is_not_judged() -> None:
    found = modes(FOUCAULT.replace("k: w0**2", "k: -0.1"))
    root = np.sqrt(0.16 - 0.1)
    np.testing.assert_allclose(found.frequencies, [0.4 - root, 0.4 + root], rtol=1e-11)
    assert found.stable is None
    assert "gyroscopic" in found.reason


def test_a_maximum_is_unstable() -> None:
    found = modes(FOUCAULT.replace("k: w0**2", "k: -1"), W=0.0)
    assert found.frequencies is None
    assert found.stable is False
    assert found.growth == pytest.approx(1.0, rel=1e-13)


@pytest.mark.parametrize("W", [2.5, 3.2])
def test_a_rolling_disk_falls_below_its_critical_spin(W: float) -> None:
    """(I + m r^2) s^2 = m g r - (J + m r^2) J W^2 / I; six zeros, of chains that no rounding may blur."""
    found = modes(DISK, W=W)
    m, r, A, J, g = 1.5, 0.4, 0.06, 0.12, 9.81
    square = (m * g * r - (J + m * r**2) * J * W**2 / A) / (A + m * r**2)
    assert found.about == "steady"
    assert found.at["rate(ps)"] == W
    assert np.count_nonzero(found.eigenvalues) == 2
    if square > 0:
        np.testing.assert_allclose(
            sorted(found.eigenvalues.real)[::7], [-(square**0.5), square**0.5], rtol=1e-11
        )
        assert found.stable is False
    else:
        np.testing.assert_allclose(found.frequencies, [0, 0, 0, 0, (-square) ** 0.5], rtol=1e-11)
        assert found.stable is None


def test_the_turning_of_a_reference_is_in_the_linear_equations() -> None:
    """A conical pendulum in angles: w^2 = W^2 (1 + 3 cos^2 a), with a cyclic angle that leaves a zero."""
    text = """\
lagcli: 1
parameters: {g: 9.81, a: 0.7}
coordinates: {th: {value: a}, ph: {value: 0, rate: sqrt(g/cos(a))}}
lagrangian: (rate(th)**2 + sin(th)**2*rate(ph)**2)/2 + g*cos(th)
"""
    found = modes(text)
    square = 9.81 / np.cos(0.7) * (1 + 3 * np.cos(0.7) ** 2)
    assert found.about == "steady"
    np.testing.assert_allclose(found.frequencies, [0, np.sqrt(square)], rtol=1e-12)
    np.testing.assert_allclose(found.shapes[0], [0, 1], atol=1e-12)


def test_a_mass_on_a_spring_that_falls_swings_as_at_rest() -> None:
    """Steady too is a motion of constant acceleration: the coordinate that falls leaves its zero."""
    text = """\
lagcli: 1
parameters: {g: 9.81, k: 7}
particles: {a: {mass: 1, position: [0, 0, 0]}, b: {mass: 2, position: [1, 0, 0]}}
forces:
  weight: {to: all, force: [0, 0, -m*g]}
  spring: {potential: "k/2*(distance(a, b) - 1)**2"}
"""
    found = modes(text)
    assert found.about == "steady"
    np.testing.assert_allclose(found.frequencies, [0, 0, 0, 0, 0, np.sqrt(7 * 1.5)], rtol=1e-12)


def test_damping_makes_it_asymptotically_stable() -> None:
    text = "lagcli: 1\ncoordinates: {x: {}}\nlagrangian: rate(x)**2/2 - 2*x**2\nforces: {d: {to: x, force: -rate(x)}}\n"
    found = modes(text)
    assert found.frequencies is None
    np.testing.assert_allclose(found.eigenvalues, [-0.5 + 3.75**0.5 * 1j, -0.5 - 3.75**0.5 * 1j], rtol=1e-14)
    assert found.stable is True
    assert found.growth == pytest.approx(-0.5)


def test_a_differential_row_that_can_be_integrated_leaves_no_zero_behind() -> None:
    """A cylinder that rolls on a line, held by a spring: one frequency, as with the integrated row."""
    text = """\
lagcli: 1
parameters: {k: 3, r: 0.5}
coordinates: {x: {value: 0}, phi: {value: 0}}
lagrangian: rate(x)**2/2 + 0.125*rate(phi)**2/2 - k*x**2/2
ROW
"""
    rolling = modes(text.replace("ROW", "differential: {roll: rate(x) = r*rate(phi)}"))
    whole = modes(text.replace("ROW", "holonomic: {roll: x = r*phi}"))
    np.testing.assert_allclose(rolling.frequencies, [np.sqrt(2)], rtol=1e-13)
    np.testing.assert_allclose(whole.frequencies, rolling.frequencies, rtol=1e-13)


def test_a_sleigh_at_rest_has_zeros_for_its_positions_and_its_speeds() -> None:
    text = """\
lagcli: 1
coordinates: {x: {}, y: {}, th: {}}
lagrangian: rate(x)**2/2 + rate(y)**2/2 + rate(th)**2/2
differential: {edge: rate(y)*cos(th) = rate(x)*sin(th)}
"""
    found = modes(text)
    assert found.eigenvalues.tolist() == [0] * 5
    assert found.frequencies.tolist() == [0] * 3
    assert found.stable is None


def test_a_contact_that_presses_is_a_row_and_an_open_one_is_none() -> None:
    text = """\
lagcli: 1
parameters: {k: 5, h: 0}
particles: {a: {mass: 2, position: [0, 0, h]}}
forces:
  weight: {to: a, force: [0, 0, -9.81*m]}
  spring: {potential: k*(a.x**2 + 4*a.y**2)/2}
inequality: {floor: a.z >= 0, ceiling: a.z <= 1}
"""
    found = modes(text)
    np.testing.assert_allclose(found.frequencies, np.sqrt([2.5, 10]), rtol=1e-13)
    assert any("`floor`" in note and "ceiling" not in note for note in found.notes)


@pytest.mark.parametrize(
    ("start", "law", "about"),
    [
        ("[0, 0, 1]", "a.z >= 0", "equilibrium"),  # it falls in 0.45, and lies then
        (
            "[0, 0, 1], velocity: [0.5, 0, 3]",
            "a.z >= 0",
            None,
        ),  # it moves, and comes down in the time of the run
        ("[0, 0, 1], velocity: [0.5, 0, 0]", "a.x <= 0.9", None),  # a wall in its way, and no floor
        ("[0, 0, 1], velocity: [0.5, 0, 0]", "a.x <= 6", "steady"),
        ("[0, 0, 21]", "a.z >= 0", "steady"),  # nothing closes in the time of the run
    ],
)
def test_a_contact_that_closes_on_the_way_ends_a_steady_motion(start, law, about) -> None:
    text = f"""\
lagcli: 1
particles: {{a: {{mass: 2, position: {start}}}}}
forces: {{weight: {{to: a, force: [0, 0, -9.81*m]}}}}
inequality: {{stop: {law}}}
simulation: {{duration: 2}}
"""
    if about is None:
        with pytest.raises(NoEquilibriumError, match="the start moves, and it is no steady motion"):
            modes(text)
        return
    found = modes(text)
    assert found.about == about
    assert len(found.frequencies) == (2 if about == "equilibrium" else 3)
    assert any("`stop`" in note for note in found.notes) == (about == "equilibrium")


@pytest.mark.parametrize(("k", "m", "w"), [(3.3, 1.37, 0.9), (37.1, 0.61, 2.3), (1234.5, 0.07, 17.0)])
def test_a_steady_motion_whose_forces_cancel_within_h_is_steady(k: float, m: float, w: float) -> None:
    """A mass on a spring that turns: k (r - L) = m r w^2 leaves of h its rounding, beside which nothing balances."""
    found = lagcli.modes(
        lagcli.loads(f"""
lagcli: 1
parameters: {{k: {k}, L: 0.71, m: {m}, w: {w}}}
coordinates: {{r: {{value: k*L/(k - m*w**2)}}, phi: {{rate: w}}}}
lagrangian: m/2*(rate(r)**2 + r**2*rate(phi)**2) - k/2*(r - L)**2
""")
    )
    assert found.about == "steady"
    assert found.frequencies is not None
    np.testing.assert_allclose(found.frequencies[-1], np.sqrt(k / m + 3 * w**2), rtol=1e-12)


def test_a_particle_that_falls_freely_is_not_one_without_freedom() -> None:
    """All eigenvalues are zero, which is not that there are none."""
    found = lagcli.modes(
        lagcli.loads("""
lagcli: 1
particles: {a: {mass: 1, position: [0, 0, 1]}}
forces: {weight: {to: all, force: [0, 0, -9.81*m]}}
""")
    )
    assert found.stable is None
    assert found.reason.startswith("6 eigenvalues are zero")


@pytest.mark.parametrize("duration", ["10", "1e150", "1e160", "1e300"])
def test_a_duration_beyond_all_doubles_makes_no_motion_steady(duration: str) -> None:
    text = f"""
lagcli: 1
particles: {{a: {{mass: 1, position: [1, 0, 0]}}}}
forces: {{spring: {{potential: a.x**2}}}}
simulation: {{duration: {duration}}}
"""
    found = lagcli.modes(lagcli.loads(text))
    assert found.at["a.x"] == pytest.approx(0, abs=1e-9)
    assert max(found.frequencies) == pytest.approx(2**0.5)
    lagcli.derive(lagcli.loads(text))


@pytest.mark.parametrize("z", [0, 300, 400, 700])
def test_modes_do_not_hang_on_the_size_of_an_integral(z: int) -> None:
    """y exp(-z) is an integral, whose gradient has no square in doubles from z = 373 on."""
    found = lagcli.modes(
        lagcli.loads(f"""
lagcli: 1
particles: {{a: {{mass: 1, position: [0, 1, {z}]}}}}
forces:
  spring: {{potential: "(a.z - {z})**2/2 + a.x**2 - a.y + (a.y - 1)**2/2"}}
  pull: {{to: a, force: [0, 0, -1]}}
differential: {{log: "d(a.y)/a.y = d(a.z)"}}
""")
    )
    assert found.frequencies == pytest.approx([0.5**0.5, 2**0.5], abs=1e-9)
