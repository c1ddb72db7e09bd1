"""Frozen dataclasses whose methods are shared: at import no code is written for them.

`dataclasses.dataclass(frozen=True, slots=True)` writes and compiles up to nine methods for each class, half a
millisecond, and a start of the program imports more than a hundred of them. An object of these classes takes two
microseconds more to make: what a run makes at every step is an ordinary dataclass.
"""

from __future__ import annotations

import dataclasses
from typing import ClassVar, NoReturn, TypeVar, dataclass_transform

T = TypeVar("T")


@dataclass_transform(frozen_default=True, eq_default=False, field_specifiers=(dataclasses.field,))
def frozen(cls: type[T]) -> type[T]:
    """The class as a frozen dataclass, each object of which is equal to itself alone."""
    names = "__init__", "__repr__", "__setattr__", "__delattr__"
    return _with(names, dataclasses.dataclass(init=False, repr=False, eq=False)(cls))


@dataclass_transform(frozen_default=True, field_specifiers=(dataclasses.field,))
def frozen_value(cls: type[T]) -> type[T]:
    """The class as a frozen dataclass whose objects are equal where their fields are."""
    return _with(("__eq__", "__hash__"), frozen(cls))


def _with(names: tuple[str, ...], cls: type[T]) -> type[T]:
    """The class with the shared methods of these names, but for those that it defines itself."""
    for name in names:
        if name not in cls.__dict__:
            setattr(cls, name, _Shared.__dict__[name])
    return cls


class _Shared:
    """The methods: none of their objects is of this class."""

    __dataclass_fields__: ClassVar[dict[str, dataclasses.Field[object]]]
    __match_args__: ClassVar[tuple[str, ...]]

    def __init__(self, /, *values: object, **named: object) -> None:
        names, fields = self.__match_args__, self.__dataclass_fields__
        given = dict(zip(names, values, strict=False)) | named
        # As many as were given where none is given twice.
        if len(given) < len(values) + len(named) or not fields.keys() >= named.keys():
            raise TypeError(f"{type(self).__name__} takes each of {', '.join(names)} once, and nothing else")
        if len(given) < len(names):
            given |= {name: _default(self, name) for name in names if name not in given}
        self.__dict__.update(given)

    def __setattr__(self, name: str, value: object) -> NoReturn:
        raise dataclasses.FrozenInstanceError(f"{name} of a {type(self).__name__} cannot be changed")

    def __delattr__(self, name: str) -> NoReturn:
        raise dataclasses.FrozenInstanceError(f"{name} of a {type(self).__name__} cannot be deleted")

    def __repr__(self) -> str:
        shown = (field.name for field in dataclasses.fields(self) if field.repr)
        return f"{type(self).__qualname__}({', '.join(f'{name}={getattr(self, name)!r}' for name in shown)})"

    def __eq__(self, other: object) -> bool:
        return _compared(self) == _compared(other) if type(other) is type(self) else NotImplemented

    def __hash__(self) -> int:
        return hash(_compared(self))


def _default(made: _Shared, name: str) -> object:
    field = made.__dataclass_fields__[name]
    if field.default_factory is not dataclasses.MISSING:
        return field.default_factory()
    if field.default is dataclasses.MISSING:
        raise TypeError(f"{type(made).__name__} needs {name}")
    return field.default


def _compared(made: _Shared) -> tuple[object, ...]:
    values, fields = made.__dict__, made.__dataclass_fields__
    return tuple([values[name] for name in made.__match_args__ if fields[name].compare])
