"""Ranks in many digits: where doubles do not tell nearly dependent rows from dependent ones."""

from __future__ import annotations

import decimal
from decimal import Decimal

import numpy as np
import pytest

import lagcli
from lagcli.api import cache
from lagcli.errors import diagnostics
from lagcli.linear import rank
from lagcli.start import assembly, initial, precise_rows, projection

pytestmark = pytest.mark.numeric

PLANES = """
lagcli: 1
parameters: {{d: {d}}}
particles: {{a: {{mass: 1, position: [0, 0.2, 0.3]}}}}
holonomic: {{first: a.x = 0, second: {second}}}
"""
TILTED = "a.x + d*a.y = d*0.2"
# The same plane, as a surface whose rows are not constant.
CURVED = "(a.x + d*a.y - d*0.2)*(2 + a.z) = 0"


def exact(d: str, second: str = TILTED) -> int | None:
    """The rank in many digits at the declared start, None where it is not known."""
    ready = cache.compiled(lagcli.loads(PLANES.format(d=d, second=second)))
    rows = projection.rows(ready.numeric, initial.declared(ready.system))
    return rows.rank_in_digits


@pytest.mark.parametrize("d", ["1e-3", "3e-7", "1e-8", "1e-10", "1e-12"])
@pytest.mark.parametrize("second", [TILTED, CURVED])
def test_rows_that_differ_in_some_digit_are_independent(d: str, second: str) -> None:
    ready = cache.compiled(lagcli.loads(PLANES.format(d=d, second=second)))
    rows = projection.rows(ready.numeric, initial.declared(ready.system))
    assert rank.estimate(rows).value == 2
    assert rank.nearest_dependence(rows)[0] == pytest.approx(float(d) / np.sqrt(2), rel=1e-4)


def test_rows_within_the_rounding_of_their_coefficients_are_dependent() -> None:
    assert exact("3e-14") == 2  # 2.1e-14 from dependent ones
    assert exact("1e-15") is None  # there is no doubt
    assert exact("3e-15", CURVED) is None


def moved_to(shift: str, d: str) -> int | None:
    """The rank of the curved rows where the first plane lies by `shift` beside the start."""
    second = CURVED.replace("(a.x", f"(a.x - {shift}")
    text = PLANES.format(d=d, second=second).replace("a.x = 0", f"a.x = {shift}")
    ready = cache.compiled(lagcli.loads(text))
    rows = projection.rows(ready.numeric, initial.declared(ready.system))
    return rows.rank_in_digits


def test_a_state_is_on_the_surface_to_forty_digits() -> None:
    assert moved_to("2e-41", "1e-11") == 2
    assert moved_to("1.5e-40", "1e-11") is None  # too near to dependent rows to be moved


def test_a_sum_that_differs_from_one_in_the_ninth_digit_has_more_than_six() -> None:
    assert exact("1e-9", "a.y + (1 + d)*a.z = 0.2 + (1 + d)*0.3, third: a.y + a.z = 0.5") == 3


def test_a_state_is_moved_where_rows_are_clear_to_ten_digits() -> None:
    assert moved_to("1e-17", "3e-10") == 2
    assert moved_to("1e-17", "1e-10") is None


def test_a_move_is_far_shorter_than_the_way_to_dependent_rows() -> None:
    # The rows are 7e-7 from dependent ones, at coordinates of 0.3.
    assert moved_to("1e-10", "1e-6") == 2
    assert moved_to("1e-9", "1e-6") is None


def test_rows_of_many_entries_are_looked_at_in_doubles() -> None:
    def chain(count: int) -> str:
        particles = f"'p[i]': {{for: 'i = 1..{count}', mass: 1, position: [i, 0, 0]}}"
        rows = f"'flat[i]': {{for: 'i = 1..{count}', equation: 'p[i].z = 0'}}"
        again = "more: 'p[1].z + 1e-9*p[2].x = 2e-9', third: 'p[2].z + 1e-9*p[1].z = 0'"
        return f"lagcli: 1\nparticles: {{{particles}}}\nholonomic: {{{rows}, {again}}}\n"

    for count, known in ((60, 61), (66, None)):  # (count + 2) 3 count entries: 11 160 and 13 464
        ready = cache.compiled(lagcli.loads(chain(count)))
        rows = projection.rows(ready.numeric, initial.declared(ready.system))
        assert rows.rank_in_digits == known
    assert precise_rows.PARAMETERS.most == 12_000


def test_rows_that_follow_from_rows_before_them_are_found_in_their_order() -> None:
    rows = [
        ["1e-9000", "2e-9000", "0"],
        ["0", "0", "0"],
        ["3", "6", "1e-30"],
        ["4", "8", "0"],
        ["0", "0", "7"],
    ]
    with decimal.localcontext(prec=60):
        assert precise_rows.following([[Decimal(a) for a in row] for row in rows]) == [1, 3, 4]


# A velocity that only many digits tell: n2 and n3 are one line but for `rest`, far below what both are multiplied by.
GAINED = """
lagcli: 1
coordinates: {{x: {{value: 1/7}}, y: {{value: 0.7}}, z: {{value: 1.3}}}}
lagrangian: rate(x)**2/2 + rate(y)**2/2 + rate(z)**2/2
simulation: {{assemble: true, duration: 1}}
differential:
  n2: "1e6*d(x) - 1e6*x*d(y) = 0"
  n3: "{gain}*d(x) - {gain}*x*d(y) + {rest} = 0"
"""
WALKS = "d(z) - exp(-t)*dt"


@pytest.mark.parametrize("gain", ["1", "1e6", "1e12", "1e13", "1e14", "1e20"])
def test_what_rows_are_multiplied_by_changes_no_count(gain: str) -> None:
    assert lagcli.dof(lagcli.loads(GAINED.format(gain=gain, rest=WALKS))).configuration_dof == 1


@pytest.mark.parametrize("gain", ["1e12", "1e13", "1e14"])
def test_the_nearest_velocity_has_all_digits_of_rows_of_large_coefficients(gain: str) -> None:
    ready = cache.compiled(lagcli.loads(GAINED.format(gain=gain, rest=WALKS)))
    state = assembly.assemble(ready.system, ready.numeric, initial.declared(ready.system), ()).state
    assert state.v == pytest.approx([0.0, 0.0, 1.0], abs=1e-12)


@pytest.mark.parametrize("gain", ["1e12", "1e13", "1e14"])
@pytest.mark.parametrize("more", ["", '\n  n4: "3*d(x) - 3*x*d(y) = 0"'])
def test_a_run_with_rows_that_doubles_do_not_tell_apart_is_refused_for_that(gain: str, more: str) -> None:
    text = GAINED.format(gain=gain, rest=WALKS) + more.lstrip("\n")
    with pytest.raises(diagnostics.ModelError, match="their multipliers would have no right digit"):
        lagcli.simulate(lagcli.loads(text))


@pytest.mark.parametrize("rest", ["dt", "(x - 1/7)*d(z) - dt", "(7*x - 1)*d(z) - dt"])
def test_rows_that_contradict_each_other_do_so_with_large_coefficients(rest: str) -> None:
    """A part that vanishes at the start has rounding there, which is no direction."""
    with pytest.raises(diagnostics.ModelError) as caught:
        lagcli.simulate(lagcli.loads(GAINED.format(gain="1e12", rest=rest)))
    assert [one.code for one in caught.value.diagnostics] == ["contradictory-constraints"]
