"""Numbers that decide about a start: on either side of each the answer is another."""

import casadi as ca
import numpy as np
import pytest

import lagcli
from lagcli.api import cache
from lagcli.linear.metric import Metric
from lagcli.linear.metric_rows import LocalRows
from lagcli.start import assembly, conflict, gaps, initial, lipschitz, projection


def ready(coordinates: str, more: str = "", duration: float = 1.0) -> cache.CompiledModel:
    """A model with unit inertia; `coordinates` as "x=1 y", or as "x=1/2" with the rate 2."""
    lines = ["lagcli: 1", "coordinates:"]
    names = []
    for word in coordinates.split():
        name, _, start = word.partition("=")
        value, _, rate = start.partition("/")
        names.append(name)
        lines.append(f"  {name}: {{value: {value or 0}, rate: {rate or 0}}}")
    lines += ["lagrangian: " + " + ".join(f"rate({name})**2/2" for name in names)]
    return cache.compiled(
        lagcli.loads("\n".join([*lines, more, "simulation:", f"  duration: {duration}"]) + "\n")
    )


def is_consistent(model: cache.CompiledModel) -> bool:
    return initial.residuals(model.system, model.numeric, initial.declared(model.system)).consistent


@pytest.mark.parametrize(("off", "answer"), [(3e-10, True), (3e-9, False)])
def test_a_start_is_on_a_row_to_the_digits_of_decimals(off: float, answer: bool) -> None:
    assert is_consistent(ready(f"x={1 + off!r} y", "holonomic:\n  row: x = 1\n")) is answer


@pytest.mark.parametrize(("off", "answer"), [(3e-13, True), (3e-12, False)])
def test_a_coordinate_near_zero_has_the_rounding_of_larger_ones(off: float, answer: bool) -> None:
    assert is_consistent(ready(f"x={off!r} y=1", "holonomic:\n  row: x = 0\n")) is answer


@pytest.mark.parametrize(("rate", "answer"), [(3e-16, True), (3e-15, False)])
def test_a_system_at_rest_has_the_rounding_of_its_speeds(rate: float, answer: bool) -> None:
    assert is_consistent(ready(f"x=0/{rate!r} y=1", "differential:\n  row: d(x) = 0\n")) is answer


@pytest.mark.parametrize(("off", "answer"), [(1e-6, [0, 1]), (1e-8, [])])
def test_rows_contradict_each_other_beyond_rounding(off: float, answer: list[int]) -> None:
    rows = LocalRows(ca.DM([[1.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))
    assert conflict.least(rows, np.array([0.0, off, 1.0])) == answer


@pytest.mark.parametrize(("z", "moved"), [(-1e-13, True), (-2e-15, False)])
def test_a_gap_of_some_digits_is_brought_to_zero(z: float, moved: bool) -> None:
    model = ready(f"x=1 z={z!r}", "inequality:\n  floor: z >= 0\n")
    start = initial.declared(model.system)
    assert bool(gaps.settled(model.system, model.numeric, start).q[1] != z) is moved


@pytest.mark.parametrize(("ratio", "told"), [(5e-4, True), (5e-3, False)])
def test_an_inertia_has_fallen_below_a_thousandth(ratio: float, told: bool) -> None:
    before, now = ca.diag(ca.DM([1.0, 1.0])), ca.diag(ca.DM([1.0, ratio]))
    assert bool(initial.fallen(now, before, ["x", "y"])) is told


@pytest.mark.parametrize(("below", "said"), [(1.2e-9, "singular"), (1.2e-8, "negative")])
def test_an_inertia_is_negative_beyond_rounding(below: float, said: str) -> None:
    M, model = np.array([[1.0, 1.0], [1.0, 1.0 - below]]), ready("x=1 y=1").system.model
    assert said in initial.indefinite(M, model).message


@pytest.mark.parametrize(("slope", "stuck"), [(1e-6, True), (1e-4, False)])
def test_a_row_that_hardly_acts_on_what_may_move_is_stuck(slope: float, stuck: bool) -> None:
    model = ready("x=1 y", f"holonomic:\n  row: x + {slope}*y = 1\n")
    start = initial.declared(model.system)
    if stuck:
        with pytest.raises(lagcli.ModelError, match="nothing is left to satisfy"):
            assembly.assemble(model.system, model.numeric, start, ("x",))
    else:
        assert assembly.assemble(model.system, model.numeric, start, ("x",)).moved == 0.0


@pytest.mark.parametrize(("power", "warned"), [(0.9, True), (0.97, False)])
def test_slopes_that_grow_without_bound_are_warned_of(power: float, warned: bool) -> None:
    model = ready("x y=1", f"forces:\n  f: {{to: x, force: abs(x)**{power}}}\n")
    start = initial.declared(model.system)
    assert bool(lipschitz.warnings(model.system, model.numeric, start)) is warned


@pytest.mark.parametrize(("v", "apart"), [(-2999999.75, "0.25"), (-3e6, "0")])
def test_a_switch_is_near_by_the_rounding_of_its_terms(v: float, apart: str) -> None:
    law = f"holonomic:\n  row: abs(v + 1000*x) = {apart}\n"
    if v > -3e6:
        assert is_consistent(ready(f"x=3000 v={v!r}", law))
    else:
        with pytest.raises(lagcli.ModelError, match="kink-at-start"):
            ready(f"x=3000 v={v!r}", law)


def surface(law: str, coordinates: str = "x y") -> tuple[projection.Surface, np.ndarray]:
    model = ready(coordinates, f"holonomic:\n  row: {law}\n")
    start = initial.declared(model.system)
    return projection.Surface(model.numeric, start.t, start.p, Metric.unit(start.q.size)), start.q


def test_newton_from_beside_a_double_root_only_halves_the_distance() -> None:
    found, q = surface("(x - 1)**2 = 0", "x=1.001 y")
    assert found.nearby(q) is None
    simple, q = surface("x**2 = 1", "x=1.001 y")
    assert simple.nearby(q) == pytest.approx([1.0, 0.0], abs=1e-14)
