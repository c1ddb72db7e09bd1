"""Rows that vanish on the surface of the holonomic ones say nothing, however they are written; numbers without a
value on it are judged and not warned of."""

import warnings

import numpy as np
import pytest

import lagcli

pytestmark = pytest.mark.numeric

CIRCLE, DIAGONAL = "x**2 + y**2 = 1", "x = y"
STARTS = {CIRCLE: (1, 0), "sqrt(x**2 + y**2) = 1": (1, 0), "x**2 + y**2 = R**2": (2, 0), "x*y = 1": (1, 1)}


def model(surface, row, start=None):
    x, y = start or STARTS.get(surface, (0.5, 0.5))
    return lagcli.loads(
        "lagcli: 1\nparameters: {R: 2}\n"
        f"coordinates: {{x: {{value: {x}}}, y: {{value: {y}}}, z: {{value: 0.2}}, w: {{value: 0.1}}}}\n"
        'lagrangian: "(rate(x)**2 + rate(y)**2 + rate(z)**2 + rate(w)**2)/2"\n'
        f'holonomic: {{held: "{surface}"}}\ndifferential: {{row: "{row} = 0"}}\n'
    )


def judged(surface, row, start=None):
    found = lagcli.check(model(surface, row, start))
    one = found.constraints[1]
    return one.verdict, one.redundant, found


@pytest.mark.parametrize(
    ("surface", "row"),
    [
        (CIRCLE, "(x**2 + y**2 - 1)*d(z)"),
        (CIRCLE, "(x**2 + y**2 - 1)*(x**2 + y**2 - 4)*d(z)"),
        (CIRCLE, "(1/(x**2 + y**2) - 1)*d(z)"),
        (CIRCLE, "(x**2 + y**2 - 1)*(z*d(w) + d(z))"),
        (CIRCLE, "(sqrt(x**2 + y**2) - 1)*d(z)"),
        (CIRCLE, "log(x**2 + y**2)*d(z)"),
        (CIRCLE, "(atan(x**2 + y**2) - pi/4)*w*d(z)"),
        (CIRCLE, "(exp(x**2) - exp(1 - y**2))*d(z)"),
        ("x**2 + y**2 = R**2", "(sqrt(x**2 + y**2) - R)*d(z)"),
        ("sqrt(x**2 + y**2) = 1", "log(sqrt(x**2 + y**2))*d(z)"),
        ("x*y = 1", "(log(x) + log(y))*d(z)"),
        (DIAGONAL, "(sin(x) - sin(y))*d(z)"),
        (DIAGONAL, "(x - y)*d(x)"),
    ],
)
def test_a_factor_that_vanishes_on_the_surface_is_not_divided_out(surface, row):
    verdict, is_redundant, found = judged(surface, row)
    assert (verdict.kind, verdict.integral, verdict.integrating_factor) == ("exact", None, None)
    assert "says nothing" in verdict.method
    assert is_redundant
    assert found.dof.configuration_dof == 3
    assert not found.joint.integrals


@pytest.mark.parametrize(
    ("row", "integral"),
    [
        ("(x**2 + y**2 - 4)*d(z)", "z"),
        ("(x**2 + y**2 - 1)*w*d(x) + y*d(z)", "z"),
        ("(sqrt(x**2 + y**2) - 1)*d(z) + y*d(w)", "w"),
        ("(sqrt(x**2 + y**2) - 2)*d(z)", "z"),
    ],
)
def test_what_does_not_vanish_on_the_surface_is_enforced(row, integral):
    # Where y = 0 such a row vanishes too, and frees what it holds elsewhere.
    verdict, is_redundant, found = judged(CIRCLE, row, start=(0.6, 0.8))
    assert verdict.integral == integral
    assert not is_redundant
    assert found.dof.configuration_dof == 2


@pytest.mark.parametrize(
    ("surface", "row"),
    [
        ("y*exp(x) = 0", "d(w) - y*x*d(z)"),
        ("x*y = 0", "y*d(z) - z*d(y)"),
        ("y = z", "d(w) - exp(300*y)*d(y)"),
        ("y*z = 0", "d(w) - y/x*d(z)"),
    ],
)
def test_numbers_without_a_value_are_no_warnings(surface, row):
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        flat = lagcli.loads(
            "lagcli: 1\ncoordinates: {x: {value: 1}, y: {value: 0}, z: {value: 0}, w: {value: 0.1}}\n"
            'lagrangian: "(rate(x)**2 + rate(y)**2 + rate(z)**2 + rate(w)**2)/2"\n'
            f'holonomic: {{flat: "{surface}"}}\ndifferential: {{row: "{row} = 0"}}\n'
        )
        lagcli.dof(flat)


def test_displacements_of_huge_rows_and_of_the_shortest_run_are_finite():
    huge = (
        "lagcli: 1\ncoordinates: {x: {value: 1}, y: {value: 0}, w: {value: 0.1}}\n"
        'lagrangian: "(rate(x)**2 + 1e300*rate(y)**2 + rate(w)**2)/2"\n'
        'holonomic: {flat: "1e300*y*exp(x) = 0"}\ndifferential: {row: "1e300*d(w) - 1e308*y*d(x) = 0"}\n'
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        found = lagcli.displacements(lagcli.loads(huge))
        assert np.isfinite(found.components.T).all()
        assert found.bases.rank == 2
        late = lagcli.displacements(model(CIRCLE, "d(z) - x*d(w)"), at=5e-324)
        assert np.isfinite(late.bases.virtual).all()
