"""The numbers of searches beside a start, and of what is said of its forces and inertia: on either side another."""

import numpy as np
import pytest

from lagcli.start import initial
from lagcli.start.configuration_search import Search

# Other starts of a search for a configuration


def searching(count, monkeypatch):
    """A search in which rows hold so many coordinates, of size 1."""
    monkeypatch.setattr(Search, "touched", lambda self, rows: np.ones(count, dtype=bool))
    monkeypatch.setattr(Search, "size", lambda self, q, touched: 1.0)
    return Search.__new__(Search)


def test_other_starts_lie_aside_by_a_hundredth_to_three_times_the_size(monkeypatch):
    starts = [*searching(60, monkeypatch).neighbours(np.zeros(60), [0])]
    aside = np.std(starts, axis=1).reshape(5, -1).mean(axis=1)
    assert aside == pytest.approx([0.01, 0.1, 0.3, 1.0, 3.0], rel=0.3)


@pytest.mark.parametrize(("count", "starts"), [(60, 5 * 4), (61, 5 * 2), (400, 5 * 2), (401, 3)])
def test_of_more_coordinates_there_are_fewer_other_starts(count, starts, monkeypatch):
    assert len([*searching(count, monkeypatch).neighbours(np.zeros(count), [0])]) == starts


# Inertia that is none


def test_four_coordinates_of_a_motion_are_named():
    names = [f"q{i}" for i in range(6)]
    assert initial._motion(np.ones(6), names).endswith("rate(q3) = 1 and 2 more)")
