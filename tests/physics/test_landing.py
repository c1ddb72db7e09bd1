"""Many particles that land one by one: work grows no faster than the table does, and the motion is the known one."""

import numpy as np
import pytest
from scipy import optimize

import lagcli
from lagcli import memory
from lagcli.contact import complementarity
from lagcli.simulation.scheme.dop853 import DormandPrince853
from tests.helpers.spent import at_most_calls

pytestmark = pytest.mark.numeric

G = 9.81


def landing(N: int, height: str = "1 + 0.3*sin(7*i)", force: str = "-9.81*m", more: str = "") -> lagcli.Model:
    text = f"""lagcli: 1
parameters: {{N: {N}}}
particles:
  p[i]: {{for: "i = 1..N", mass: "1 + 0.1*i", position: ["i", 0, "{height}"]}}
forces:
  applied[i]: {{for: "i = 1..N", to: "p[i]", force: [0, 0, "{force}"]}}
{more}inequality:
  floor[i]: {{for: "i = 1..N", condition: "p[i].z >= 0", restitution: 0}}
simulation: {{duration: 1, samples: 11, rtol: 1e-8, atol: 1e-10}}
"""
    return lagcli.loads(text)


@pytest.mark.parametrize("N", [20, 40, 80])
def test_particles_that_land_one_by_one_cost_work_by_the_square_of_their_number_at_most(N):
    lagcli.simulate(landing(2))
    # Calls for the model and two sets of functions, of which older libraries need more, for each landing, and for each
    # particle in each landing. Functions of its own for each set of contacts made some 26 000 a landing.
    with at_most_calls(110_000 + 5_000 * N + 70 * N**2):
        found = lagcli.simulate(landing(N))
    heights = 1 + 0.3 * np.sin(7 * np.arange(1, N + 1))
    impacts = found.events["t"][found.events["kind"] == "impact"]
    assert impacts == pytest.approx(np.sort(np.sqrt(2 * heights / G)), abs=1e-12)
    masses = 1 + 0.1 * np.arange(1, N + 1)
    for i, (height, mass) in enumerate(zip(heights, masses, strict=True), start=1):
        t = found.t
        falls = t < np.sqrt(2 * height / G)
        assert found[f"p[{i}].z"] == pytest.approx(np.where(falls, height - G * t**2 / 2, 0.0), abs=1e-12)
        assert found[f"p[{i}].vz"] == pytest.approx(np.where(falls, -G * t, 0.0), abs=1e-12)
        for column in (f"lambda.floor[{i}]", f"R.p[{i}].z"):
            assert found[column] == pytest.approx(np.where(falls, 0.0, mass * G), rel=1e-12)


def test_functions_of_steps_are_built_for_two_sets_of_contacts_whatever_lands(monkeypatch):
    """All open, and any closed."""
    memory.forget()
    step, built = DormandPrince853.step, []

    def counted(self, numeric):
        built.append(numeric)
        return step(self, numeric)

    monkeypatch.setattr(DormandPrince853, "step", counted)
    found = lagcli.simulate(landing(12))
    assert found.stats.impacts == 12
    assert len(built) == 2


def test_the_problem_of_an_impact_is_that_of_the_bodies_that_are_struck(monkeypatch):
    """A rod joins the fifth particle and the sixth: what lands beside them is a formula."""
    solve, sizes = complementarity.solve, []

    def counted(*args):
        sizes.append(args[1].size)
        return solve(*args)

    monkeypatch.setattr(complementarity, "solve", counted)
    rod = 'holonomic:\n  rod: "norm(p[6] - p[5]) = sqrt(1.01)"\n'
    found = lagcli.simulate(landing(9, "0.2 + 0.1*i", more=rod))
    assert found.stats.impacts == 9
    assert max(sizes) == 2


def test_a_run_that_is_resumed_amid_landings_is_the_one_that_was_not(tmp_path):
    model, mark = landing(8), tmp_path / "mark.json"
    first = lagcli.simulate(model, duration=0.45, output_step=0.05, checkpoint=mark)
    then = lagcli.simulate(model, duration=1.0, output_step=0.05, resume=mark)
    whole = lagcli.simulate(model, duration=1.0, output_step=0.05)
    assert 0 < first.stats.impacts < 8
    assert [*first.events["t"], *then.events["t"]] == list(whole.events["t"])
    for column in ("p[3].z", "p[3].vz", "lambda.floor[3]", "lambda.floor[5]"):
        assert np.array_equal(then[column], whole[column][-len(then.t) :])


def test_particles_that_lie_are_lifted_one_by_one_and_land_again():
    """Each contact is switched off where the force on it changes sign, and on where it closes again."""
    found = lagcli.simulate(landing(6, "0", "9.81*m*(2*sin(3*t - 0.1*i) - 1)"), duration=2.2, samples=23)
    t, kinds = found.t, found.events["kind"]
    for i in range(1, 7):
        mass, lifted = 1 + 0.1 * i, (np.pi / 6 + 0.1 * i) / 3

        def height(at, lifted=lifted, i=i):
            phi, begin, way = 3 * at - 0.1 * i, np.pi / 6, at - lifted
            turned = np.sin(phi) - np.sin(begin)
            return G * (-2 / 9 * turned + 2 / 3 * np.cos(begin) * way - way**2 / 2)

        landed = optimize.brentq(height, lifted + 0.5, lifted + 2.0, xtol=1e-15)
        own = found.events["name"] == f"floor[{i}]"
        assert found.events["t"][own & (kinds == "release")] == pytest.approx([lifted], abs=1e-9)
        assert found.events["t"][own & (kinds == "impact")] == pytest.approx([landed], abs=1e-9)
        flies = (t > lifted) & (t < landed)
        assert flies.any()
        assert (t > landed).any()
        assert found[f"p[{i}].z"] == pytest.approx(np.where(flies, height(t), 0.0), abs=1e-9)
        pressed = mass * G * (1 - 2 * np.sin(3 * t - 0.1 * i))
        for column in (f"lambda.floor[{i}]", f"R.p[{i}].z"):
            assert found[column] == pytest.approx(np.where(flies, 0.0, pressed), abs=1e-9)
