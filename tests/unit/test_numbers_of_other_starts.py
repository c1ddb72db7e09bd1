"""The numbers of searches beside a start, and of what is said of its forces and inertia: on either side another."""

from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest

from lagcli.start import lipschitz, singular_inertia
from lagcli.start.configuration_search import Search
from lagcli.start.initial import State

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


def test_every_fifth_start_is_given_to_ipopt(monkeypatch):
    search = searching(2, monkeypatch)
    nowhere = SimpleNamespace(is_on=False, worst=1.0)
    monkeypatch.setattr(Search, "surface", lambda self, rows: SimpleNamespace(descend=lambda q: nowhere))
    monkeypatch.setattr(Search, "optimum", lambda self, rows, begin, q0: None)
    found = search.reach([0], [np.zeros(2)])
    assert (found.starts, found.by_optimization) == (21, 5)


# Slopes without a bound


def looked_at(monkeypatch, changes=None, entries=1):
    """The columns of states at which slopes are looked at, and the number of the entry that is warned of."""
    asked, warned = [], []

    def values(numeric, state, q, v):
        asked.append(q - state.q[:, None])
        return np.zeros((q.shape[1], 1)) if changes is None or q.shape[1] == 1 else changes[:, None]

    monkeypatch.setattr(lipschitz, "_values", values)
    monkeypatch.setattr(lipschitz, "_may_grow", lambda *_: True)
    monkeypatch.setattr(lipschitz, "_warning", lambda system, numeric, index: warned.append(index))
    switching = SimpleNamespace(words={"abs("})
    monkeypatch.setattr(lipschitz.named_functions, "expressions", lambda model: [switching])
    none = SimpleNamespace(nnz_out=lambda i: 0, size1_out=lambda i: 0)
    numeric = SimpleNamespace(inertia=SimpleNamespace(nnz_out=lambda i: entries), rows=none)
    system = SimpleNamespace(model=SimpleNamespace(simulation=SimpleNamespace(duration=1.0)))
    lipschitz.warnings(system, numeric, State(0.0, np.ones(1), np.ones(1), np.zeros(0)))
    return asked[1:], warned


def test_slopes_are_compared_over_a_millionth_of_the_size_and_less(monkeypatch):
    columns, _ = looked_at(monkeypatch)
    way = np.abs(columns[0][0]) / np.array([1e-2, *lipschitz.PARAMETERS.distances])
    assert way == pytest.approx(way[0], rel=1e-2)
    assert 0.2 < way[0] < 2


@pytest.mark.parametrize(("entries", "ways"), [(99_000, 3), (101_000, 1)])
def test_of_many_entries_slopes_are_looked_at_in_one_direction(entries, ways, monkeypatch):
    columns, _ = looked_at(monkeypatch, entries=entries)
    assert len(columns) == 2 * ways


# Inertia that is none


def test_four_coordinates_of_a_motion_are_named():
    names = [f"q{i}" for i in range(6)]
    assert singular_inertia._motion(np.ones(6), names).endswith("rate(q3) = 1 and 2 more)")


@pytest.mark.parametrize(("count", "is_told"), [(300, True), (301, False)])
def test_the_inertia_of_three_hundred_coordinates_is_compared(count, is_told):
    now = ca.diag(ca.DM([1e-9, *[1.0] * (count - 1)]))
    assert bool(singular_inertia.fallen(now, ca.DM.eye(count), [f"q{i}" for i in range(count)])) is is_told
