"""Numbers that decide what is said of a model: on either side of each the answer is another."""

import dataclasses

import numpy as np
import pytest

import lagcli
from lagcli.analysis import internal_forces
from lagcli.analysis.codimension import manifold, scaled_equations
from lagcli.api import cache
from lagcli.start import initial


@dataclasses.dataclass
class Line:
    """x = 0 and x + miss(y) = 0: the second follows from the first where miss vanishes."""

    size: float = 0.0
    power: int = 0
    off: float = 0.0
    rounding: float = 0.0

    def at(self, z: np.ndarray, t: float) -> tuple[np.ndarray, np.ndarray]:
        x, y = z
        s, c = (y, 1.0) if self.power else (np.sin(y), np.cos(y))
        miss, slope = self.size * s**3, 3 * self.size * s**2 * c
        return np.array([x, x + miss + self.off]), np.array([[1.0, 0.0], [1.0, slope]])


def follows(line: Line) -> bool:
    found = manifold.along(line.at, line.rounding, np.zeros(2), 0.0, 1)
    assert found is not None
    return found.satisfies_all(np.zeros(2), 0.0, ())


@pytest.mark.parametrize(("off", "answer"), [(0.0, False), (1e-12, True)])
def test_a_start_in_decimals_leaves_more_than_rounding(off: float, answer: bool) -> None:
    assert follows(Line(6e-11, off=off)) is answer


@pytest.mark.parametrize(("rounding", "answer"), [(1e-13, False), (1e-12, True)])
def test_values_may_hold_some_roundings(rounding: float, answer: bool) -> None:
    assert follows(Line(3e-11, rounding=rounding)) is answer


@pytest.mark.parametrize(("rounding", "answer"), [(1e-10, True), (1e-8, False)])
def test_rounding_may_hide_a_row_that_does_not_follow(rounding: float, answer: bool) -> None:
    assert follows(Line(rounding=rounding)) is answer


@pytest.mark.parametrize(("size", "answer"), [(1e-24, True), (1e-18, False)])
def test_a_row_that_follows_does_so_far_along_a_straight_line(size: float, answer: bool) -> None:
    assert follows(Line(size, power=1)) is answer


def part_of(*laws: str) -> scaled_equations.ScaledPart:
    rows = "".join(f"  r{i}: {law} = 0\n" for i, law in enumerate(laws))
    text = "lagcli: 1\ncoordinates: {x: {value: 0}, y: {value: 0}}\nlagrangian: rate(x)**2/2 + rate(y)**2/2\n"
    model = cache.compiled(lagcli.loads(f"{text}holonomic:\n{rows}"))
    state = initial.declared(model.system)
    return scaled_equations.part(model.system, model.numeric, state, list(range(len(laws))))


@pytest.mark.parametrize(("slope", "weight"), [(1e-6, 1e-6), (1e-8, 2.0)])
def test_a_gradient_that_is_next_to_nothing_vanishes(slope: float, weight: float) -> None:
    # Coordinates are measured so that the row, written as x**2 + slope x, has second derivatives of about one.
    assert part_of(f"x**2 + {slope!r}*x").weight[0] == pytest.approx(weight, rel=0.5)


@pytest.mark.parametrize(("jump", "answer"), [(3e-10, True), (3e-9, False)])
def test_a_gradient_that_jumps_is_not_smooth(jump: float, answer: bool) -> None:
    assert scaled_equations.is_smooth(part_of(f"x + {jump!r}*abs(y)")) is answer


def test_newton_converges_slowly_to_a_point_that_is_not_regular() -> None:
    assert manifold.codimensions(part_of("x**2*(1 + y)"), ()) == {None}
    assert manifold.codimensions(part_of("x**2 + x"), ()) == {1}


@pytest.mark.parametrize(("second", "chosen"), [(1 - 1e-10, 1), (1 - 1e-8, 0)])
def test_of_components_that_serve_alike_the_last_depends(second: float, chosen: int) -> None:
    text = "lagcli: 1\ncoordinates: {x: {}, y: {}}\nlagrangian: rate(x)**2/2 + rate(y)**2/2\n"
    found = lagcli.displacements(lagcli.loads(f"{text}holonomic: {{row: x + {second!r}*y = 0}}\n"))
    assert found.components.dependent == (chosen,)


@pytest.mark.parametrize("what", ["unbalanced", "off_line"])
@pytest.mark.parametrize(("part", "answer"), [(3e-10, True), (3e-9, False)])
def test_a_force_is_central_to_rounding(what: str, part: float, answer: bool) -> None:
    parts = {"unbalanced": 0.0, "off_line": 0.0, what: part}
    assert internal_forces.Internal(("f",), ("a", "b"), 1.0, **parts).is_central is answer
