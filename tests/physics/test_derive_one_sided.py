"""`derive` of inequalities: conditions, complementarity, contact and the law of impact, in every format."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
import pytest
import sympy

import lagcli
from lagcli import derivation
from lagcli.equations import system

DUMBBELL = """\
lagcli: 1
parameters: {m: 2, g: 9.81, r: 0.1, L: 1}
particles:
  a: {mass: m, position: [0, 0, 1]}
  b: {mass: m, position: [1, 0, 1]}
forces: {weight: {to: all, force: [0, 0, -m*g]}}
holonomic: {rod: "distance(a, b) = L"}
inequality:
  floor: {condition: "a.z >= r", restitution: 0.8}
  wall: "b.x <= 3 + 0.1*t"
"""
SPHERE = """\
lagcli: 1
parameters: {m: 2, g: 9.81, R: 1}
coordinates: {theta: {value: 0.1}, r: {value: 1}}
particles: {a: {mass: m, position: "[r*sin(theta), 0, r*cos(theta)]"}}
forces: {weight: {to: all, force: [0, 0, -m*g]}}
inequality: {sphere: "r >= R"}
"""


def derived(text: str, solve: bool = False) -> derivation.Derivation:
    # A limit beyond every machine: on a busy one twenty seconds of wall time were too few.
    return derivation.derive(system.build(lagcli.loads(text)), derivation.Options(solve, limit=600.0))


def lines(text: str, section: str, solve: bool = False) -> list[str]:
    """What stands in a section, without the numbers and in single spaces."""
    found = derived(text, solve).as_json()
    return [
        f"{one['left']} {one.get('relation', '=')} {one['right']}"
        for one in found
        if one["section"] == section and one["left"]
    ]


def test_inequalities_with_their_gradients_and_complementarity() -> None:
    assert lines(DUMBBELL, "Inequalities") == [
        "g_floor = z_a − r ≥ 0",
        "g_wall = 0.1 t − x_b + 3 ≥ 0",
        "0 ≤ λ_floor ⊥ g_floor ≥ 0",
        "0 ≤ λ_wall ⊥ g_wall ≥ 0",
    ]
    rows = lines(DUMBBELL, "Rows")
    assert rows[-5:] == [
        "G_floor,a = e_z",
        "G_wall,b = −e_x",
        "G_wall,t = 0.1",
        "ġ_floor = ż_a",
        "ġ_wall = 0.1 − ẋ_b",
    ]


def test_reactions_and_motion_hold_the_multipliers_of_inequalities() -> None:
    assert lines(DUMBBELL, "Constraint forces") == [
        "R_a = λ_rod (r_a − r_b)/d_a,b + λ_floor e_z",
        "R_b = λ_rod (r_b − r_a)/d_a,b − λ_wall e_x",
    ]
    assert "m r̈_b = −m g e_z + λ_rod (r_b − r_a)/d_a,b − λ_wall e_x" in lines(DUMBBELL, "Newton's equations")
    assert lines(SPHERE, "Constraint forces") == ["Q'_r = λ_sphere"]
    assert lines(SPHERE, "Lagrange's equations")[1].endswith("m r̈ − m r θ̇² + m g cos θ = λ_sphere")


def test_contact_is_complementary_in_accelerations() -> None:
    found = lines(SPHERE, "Contact  0 ≤ λ ⊥ G a − γ ≥ 0")
    assert found == ["g̈_sphere = r θ̇² + λ_sphere/m − g cos θ", "0 ≤ λ_sphere ⊥ g̈_sphere ≥ 0"]


def test_the_law_of_impact_with_the_restitutions() -> None:
    assert lines(DUMBBELL, "Impact") == [
        "m (ṙ_a⁺ − ṙ_a⁻) = Λ_rod (r_a − r_b)/d_a,b + Λ_floor e_z",
        "m (ṙ_b⁺ − ṙ_b⁻) = Λ_rod (r_b − r_a)/d_a,b − Λ_wall e_x",
        "ḟ_rod⁺ = 0",
        "0 ≤ Λ_floor ⊥ ġ_floor⁺ + e_floor min(ġ_floor⁻, 0) ≥ 0",
        "0 ≤ Λ_wall ⊥ ġ_wall⁺ ≥ 0",
        "e_floor = 0.8",
    ]
    assert lines(SPHERE, "Impact") == [
        "m r² (θ̇⁺ − θ̇⁻) = 0",
        "m (ṙ⁺ − ṙ⁻) = Λ_sphere",
        "0 ≤ Λ_sphere ⊥ ġ_sphere⁺ ≥ 0",
        "T⁺ − T⁻ = ½ Σ_j Λ_j (ġ_j⁺ + ġ_j⁻)",
    ]


def test_a_differential_row_holds_after_an_impact_too() -> None:
    text = SPHERE + "differential: {turn: 'rate(theta) - 2*rate(r) = 3'}\n"
    assert "θ̇⁺ − 2 ṙ⁺ − 3 = 0" in lines(text, "Impact")
    assert not any(line.startswith("T⁺") for line in lines(text, "Impact"))  # a row that moves does work


def test_solutions_of_each_contact_alone() -> None:
    """The force on a particle on a sphere is that of the textbook; the free one has none."""
    closed = lines(SPHERE, "Solution while sphere alone is closed", solve=True)
    assert "λ_sphere = m (g cos θ − R θ̇²)" in closed
    assert "θ̈ = g sin θ/R" in closed
    assert "r̈ = r θ̇² − g cos θ" in lines(SPHERE, "Solution while all contacts are open", solve=True)


def test_the_impulse_on_one_contact_is_that_of_the_linear_system() -> None:
    """A rod passes a blow on: -(1 + e) g'/(G P G^T) by numbers, of the dumbbell at an angle."""
    found = next(
        line
        for line in lines(DUMBBELL, "Solution while floor alone is closed", solve=True)
        if line.startswith("Λ_floor = ")
    )
    assert found == "Λ_floor = −(2 m L²/(2 r z_b − z_b² − r² + 2 L²)) (1 + e_floor) ġ_floor⁻"
    m, r, L, angle = 2.0, 0.1, 1.0, 0.7
    z_b = r + L * np.sin(angle)
    along = np.array([-np.cos(angle), 0, -np.sin(angle)])  # (r_a - r_b)/L
    B, G = np.concatenate([along, -along]), np.array([0, 0, 1.0, 0, 0, 0])
    P = np.eye(6) / m - np.outer(B, B) / m / (B @ B)
    assert pytest.approx(2 * m * L**2 / (2 * r * z_b - z_b**2 - r**2 + 2 * L**2), rel=1e-13) == 1 / (
        G @ P @ G
    )


def test_all_formats_write_the_signs() -> None:
    found = derived(DUMBBELL, solve=True)
    page = (
        found.html().removeprefix("<!DOCTYPE html>").replace('<meta charset="utf-8">', "").replace("<br>", "")
    )
    ElementTree.fromstring(page)
    for sign in "≤⊥≥":
        assert f"<mo>{sign}</mo>" in found.html()
    assert "<msubsup>" in found.html()
    wanted = r"0 \le \Lambda_{\mathrm{wall}} \perp \dot{g}_{\mathrm{wall}}^{+} \ge 0"
    assert wanted in found.latex()
    assert wanted in found.markdown()
    assert max(map(len, found.text(80).splitlines()[2:])) <= 90
    assert found.about.endswith("2 inequalities. (D.n): `lagcli explain D.n` says what each equation is.")
    one = next(line for line in found.as_json() if "relation" in line)
    assert (one["left"], one["right"]) == ("0", "λ_floor ⊥ g_floor ≥ 0")


def test_sympy_has_the_inequalities_and_their_forces() -> None:
    found = derived(SPHERE)
    (condition,) = found.inequalities()
    assert str(condition) == "r - R >= 0" or str(condition) == "-R + r >= 0"
    assert sympy.Symbol("lambda.sphere", real=True) in found.equations()[1].rhs.free_symbols
    assert derived(SPHERE.replace("inequality", "holonomic").replace(">=", "=")).inequalities() == ()


def test_letters_of_the_model_stay_its_own() -> None:
    text = SPHERE.replace("R: 1", "R: 1, g_sphere: 3, Lambda_sphere: 2").replace(
        "r >= R", "r >= R + g_sphere*0*Lambda_sphere"
    )
    found = lines(text, "Impact")
    assert any("impulse.sphere" in line for line in found)
