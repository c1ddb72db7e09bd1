"""The numbers that an audit judges by: two inputs beside each, with different answers."""

import numpy as np
import pytest

from lagcli.auditing.checks.audit_report import Audit, Check
from lagcli.auditing.evidence.model_values import reduced
from lagcli.auditing.evidence.virtual_space import VirtualSpace


def space(angle: float) -> VirtualSpace:
    """Of two rows at an angle to each other at one instant, and at a right angle at another."""
    return VirtualSpace(np.array([[[1.0, 0.0], [1.0, angle]], [[1.0, 0.0], [0.0, 1.0]]]))


@pytest.mark.parametrize(("angle", "rank"), [(2e-8, 2), (2e-10, 1)])
def test_rows_are_dependent_where_a_singular_value_is_a_thousand_millionth(angle: float, rank: int) -> None:
    assert space(angle).rank.tolist() == [rank, 2]


@pytest.mark.parametrize(("angle", "is_singular"), [(2e-5, False), (2e-7, True)])
def test_a_configuration_is_singular_within_a_millionth(angle: float, is_singular: bool) -> None:
    assert space(angle).is_singular.tolist() == [is_singular, False]


def motion(judged: int, entries: int = 100) -> Audit:
    """An audit of which one check of the motion judged so many of its entries."""
    check = Check("newton", "", "", "partly judged", None, judged=judged, entries=entries)
    return Audit("", "", 1, 0.0, 1.0, 1e-9, 1e-9, (check,), (), (), ())


def test_a_motion_of_which_a_tenth_is_judged_is_known_and_of_less_it_is_not() -> None:
    assert motion(11).conclusion.startswith("All checks passed where")
    assert motion(9).conclusion.startswith("Nothing was found wrong, but almost nothing")


def test_turns_of_two_angles_are_taken_out_up_to_a_thousand() -> None:
    sizes = (1.0, np.sqrt(2.0))
    for turns, is_taken in ((900, True), (9000, False)):
        f = np.array([[7.0 + turns * np.sqrt(2.0)]])
        reduced(f, {0: sizes})
        assert (abs(f[0, 0]) < 1e-10) == is_taken
