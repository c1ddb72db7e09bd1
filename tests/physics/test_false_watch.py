"""The search for singular configurations is costly: it is asked only where rows become dependent."""

import pathlib

import pytest

import lagcli
from lagcli.simulation.singularity import singularity_step

ROOT = pathlib.Path(__file__).parents[2]
NONHOLONOMIC = ("rolling-disk", "rolling-disk-particles", "knife-edge", "two-wheel-axle", "car-with-trailer")
# The gradient of `row` falls to half its length each time the coordinate x passes through zero, and rises again.
DIP = """\
lagcli: 1
coordinates: {x: {value: 1, rate: 0}, y: {}, z: {value: 0, rate: 0.5}}
lagrangian: (rate(x)**2 + rate(y)**2 + rate(z)**2)/2 - x**2/2
differential: {row: (0.3 + x**2)*d(y) - 0.2*(0.3 + x**2)*d(z) = 0}
"""
DIP = DIP.replace("y: {}", "y: {rate: 0.1}")


@pytest.fixture
def searches(monkeypatch):
    """What each search found."""
    found, search = [], singularity_step.across

    def across(*given):
        found.append(search(*given))
        return found[-1]

    monkeypatch.setattr(singularity_step, "across", across)
    return found


@pytest.mark.parametrize("rtol", [1e-4, 3e-7])
@pytest.mark.parametrize("name", NONHOLONOMIC)
def test_no_search_where_rows_only_turn(name, rtol, searches):
    lagcli.simulate(lagcli.load(ROOT / "models" / f"{name}.yaml"), rtol=rtol, samples=11)
    assert searches == []


@pytest.mark.parametrize("rtol", [1e-3, 1e-5, 1e-7, 1e-9])
def test_no_search_where_a_row_becomes_short_and_long_again(rtol, searches):
    lagcli.simulate(lagcli.loads(DIP), rtol=rtol, duration=20, samples=11)
    assert searches == []


@pytest.mark.parametrize("rtol", [1e-4, 3e-7, 1e-11])
def test_crossings_are_searched_once_or_twice(rtol, searches):
    model = lagcli.load(ROOT / "models" / "double-four-bar.yaml")
    run = lagcli.simulate(model, rtol=rtol, duration=3, samples=11)
    found = [one for one in searches if one is not None]
    assert len(found) >= len(run.stats.singular_times) >= 3
    # Where steps are long, one that begins too early to be right is tried again from closer.
    assert len(searches) <= 2 * len(found)
