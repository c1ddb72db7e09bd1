"""Points that starts, descents and deflation have missed, and a path of Newton's homotopy goes through."""

from __future__ import annotations

import pytest

import lagcli
from lagcli.statics import all_zeros, point_search
from lagcli.statics.all_zeros import Completeness

pytestmark = pytest.mark.numeric

MODEL = "lagcli: 1\ncoordinates: {x: {value: 1}, y: {value: 0.5}}\nlagrangian: (rate(x)**2 + rate(y)**2)/2\n"
QUARTIC = (
    "1.5*x**2 - 2*x*y - 1.5*y**2 - 1.25*x - 1.5*y + 1.5*y**3 + 1.75*x*y**2 + 0.5*x**2*y - 2.25*x**3"
    " + 0.125*x**4 + 0.375*y**4 - 0.03125*x**2*y**2"
)


def test_a_path_leads_to_what_all_else_has_missed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Exact algebra proves five points; the search without it finds four of them from 33 starts, with it all."""
    proved = lagcli.stationary(lagcli.loads(MODEL), QUARTIC)
    assert proved.complete
    assert len(proved) == 5
    monkeypatch.setattr(all_zeros, "by_algebra", lambda search: Completeness(False))
    found = lagcli.stationary(lagcli.loads(MODEL), QUARTIC)
    assert [point.value for point in found] == pytest.approx([point.value for point in proved], abs=1e-9)
    monkeypatch.setattr(point_search.SearchParameters, "paths", 0)
    assert len(lagcli.stationary(lagcli.loads(MODEL), QUARTIC)) < 5
