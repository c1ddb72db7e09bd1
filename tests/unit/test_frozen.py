"""Dataclasses with shared methods do what `dataclasses.dataclass(frozen=True)` makes them do."""

from __future__ import annotations

import copy
import dataclasses
import pickle
from functools import cached_property

import pytest

from lagcli.frozen import frozen, frozen_value


@frozen_value
class Point:
    """With a default, a factory, and a field that is neither compared nor shown."""

    x: float
    y: float = 2.0
    tags: tuple[str, ...] = dataclasses.field(default_factory=tuple)
    note: str = dataclasses.field(default="", compare=False, repr=False)

    @cached_property
    def square(self) -> float:
        return self.x**2 + self.y**2


@frozen
class Named:
    """One with a text of its own."""

    name: str

    def __repr__(self) -> str:
        return f"<{self.name}>"


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (Point(1.0), Point(x=1.0, y=2.0, tags=(), note="another")),
        (dataclasses.replace(Point(0.0), x=1.0, note="new"), Point(1.0)),
        (pickle.loads(pickle.dumps(Point(3.0, tags=("a",)))), Point(3.0, 2.0, ("a",))),
        (copy.copy(Point(4.0)), Point(4.0)),
    ],
)
def test_values_are_equal_where_their_fields_are(one: Point, other: Point) -> None:
    assert one == other
    assert hash(one) == hash(other)
    assert one != Point(one.x, one.y + 1.0, one.tags)


def test_others_are_equal_to_themselves_alone() -> None:
    one = Named("a")
    assert one == one
    assert one != Named("a")
    assert len({one, Named("a")}) == 2


def test_nothing_is_changed_but_what_a_property_keeps() -> None:
    point = Point(3.0, 4.0)
    assert point.square == 25.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        point.x = 1.0  # type: ignore[misc]
    with pytest.raises(dataclasses.FrozenInstanceError):
        del point.x
    assert (point.x, point.square) == (3.0, 25.0)


def test_the_text_shows_fields_and_one_of_its_own_comes_first() -> None:
    assert repr(Point(1.0, note="hidden")) == "Point(x=1.0, y=2.0, tags=())"
    assert repr(Named("a")) == "<a>"
    assert dataclasses.asdict(Point(1.0)) == {"x": 1.0, "y": 2.0, "tags": (), "note": ""}


@pytest.mark.parametrize(
    ("values", "named"),
    [((), {}), ((1.0, 2.0, (), "", 5.0), {}), ((1.0,), {"x": 1.0}), ((1.0,), {"z": 1.0})],
    ids=["missing", "too many", "twice", "unknown"],
)
def test_other_fields_than_there_are_are_refused(
    values: tuple[object, ...], named: dict[str, object]
) -> None:
    with pytest.raises(TypeError, match="Point"):
        Point(*values, **named)  # type: ignore[arg-type]
