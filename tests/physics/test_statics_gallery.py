"""The models of statics of the gallery, and what grows out of them, against closed forms."""

import math
import pathlib

import numpy as np
import pytest

import lagcli

pytestmark = pytest.mark.numeric

MODELS = pathlib.Path(__file__).parents[2] / "models"


def test_the_hanging_chain_rests_where_its_closed_form_says():
    found = lagcli.equilibrium(MODELS / "hanging-chain.yaml", starts=2)
    lowest = found[0]
    assert lowest.type == "minimum"
    model = lagcli.load(MODELS / "hanging-chain.yaml")
    values = {p.name: p.value for p in model.parameters}
    assert lowest.at["b.z"] == pytest.approx(values["z2"], abs=1e-13)
    assert lowest.multipliers["link2"] == pytest.approx(values["T2"], rel=1e-13)


def test_a_chain_of_many_links_hangs_in_a_catenary():
    text = """lagcli: 1
parameters: {N: 20, L: 2, D: 1.2, g: 9.81, m: 1/N}
particles:
  p[i]: {for: "i = 1..N-1", mass: m, position: "[i*D/N, 0, -2.6*(i/N)*(1 - i/N)]"}
forces:
  weight: {to: p, force: [0, 0, -m*g]}
holonomic:
  first: norm(p[1]) = L/N
  link[i]: {for: "i = 2..N-1", equation: "distance(p[i-1], p[i]) = L/N"}
  last: "distance(p[N-1], [D, 0, 0]) = L/N"
simulation: {assemble: true}
"""
    found = lagcli.equilibrium(lagcli.loads(text), starts=0)
    lowest = found[0]
    assert lowest.type == "minimum"
    assert lowest.residual < 1e-12
    # The catenary of the same length: L = 2 a sinh(D/(2 a)), sag a (cosh(D/(2 a)) - 1), H = m g a per length.
    low, high = 0.05, 5.0
    for _ in range(200):
        a = (low + high) / 2
        low, high = (a, high) if 2 * a * math.sinh(0.6 / a) > 2 else (low, a)
    sag = a * (math.cosh(0.6 / a) - 1)
    assert lowest.at["p[10].z"] == pytest.approx(-sag, rel=5e-3)
    # lambda of distance = length is minus the tension; its horizontal part is the same in all links.
    z = [lowest.at[f"p[{i}].z"] for i in range(1, 20)]
    x = [lowest.at[f"p[{i}].x"] for i in range(1, 20)]
    H = [-lowest.multipliers[f"link[{i}]"] * (x[i - 1] - x[i - 2]) / 0.1 for i in range(2, 20)]
    np.testing.assert_allclose(H, H[0], rtol=1e-11)
    assert H[0] == pytest.approx(9.81 / 2 * a, rel=1e-2)
    assert min(z) == pytest.approx(z[9], abs=1e-12)


@pytest.mark.parametrize(("F", "count"), [(4.8, 1), (4.85, 3)])
def test_the_column_buckles_at_its_critical_load(F, count):
    """2 (k/l) (1 - cos(pi/(2 N + 1))) = 4.8246."""
    model = lagcli.load(MODELS / "buckling-column.yaml", {"F": F})
    found = lagcli.equilibrium(model, starts=8)
    assert len(found) == count
    straight = next(p for p in found if abs(p.at["a4"]) < 1e-9)
    assert (straight.type, straight.index) == (("minimum", 0) if count == 1 else ("saddle", 1))


def test_three_bars_share_the_weight():
    found = lagcli.equilibrium(MODELS / "three-bar-truss.yaml", starts=4)
    below = next(p for p in found if p.at["joint.z"] < 0)
    assert below.type == "isolated"
    np.testing.assert_allclose(list(below.multipliers.values()), 2 * 9.81 * 1.25 / 3, rtol=1e-13)


def test_xyz_is_complete():
    found = lagcli.stationary(MODELS / "xyz-on-a-sphere.yaml", "p.x*p.y*p.z", starts=0)
    assert (len(found), found.complete) == (14, True)


@pytest.mark.parametrize(("Omega", "count"), [(3.0, 2), (8.0, 4)])
def test_the_bead_leaves_the_bottom_of_a_fast_hoop(Omega, count):
    model = lagcli.load(MODELS / "bead-on-rotating-hoop.yaml", {"Omega": Omega})
    found = lagcli.equilibrium(model, starts=4)
    assert (len(found), found.complete) == (count, True)
