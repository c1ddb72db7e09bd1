"""Reductions: what is kept of a run, as expressions of our language over the columns of its table.

Columns are arrays (T,), parameters and the results of reducing functions plain numbers. `max(x)` of one argument is the
largest over the rows, of several arguments the largest at each row.
"""

from __future__ import annotations

import dataclasses
import functools
import re
from collections.abc import Callable, Mapping, Sequence

import numpy as np
import numpy.typing as npt

from lagcli import memory, yaml_tree
from lagcli.arrays import Floats
from lagcli.errors import diagnostics
from lagcli.expression import evaluate, functions, parser, tokens, tree
from lagcli.expression.evaluate import Value
from lagcli.expression.tree import ExpressionError

Array = npt.NDArray[np.float64]
Reference = tree.Name | tree.Member | tree.Index

LABEL = "--reduce"
_PART_OF_NAME = re.compile(r"[\w.\[]")
_HINT = (
    "one number is kept of a run: max, min, mean, rms, first, last, argmax, argmin or integral of a column"
)


@dataclasses.dataclass(frozen=True, slots=True)
class Reduction:
    """A column of the sweep: its name, and what it is made of; `is_last`: the last value of the column `text`."""

    name: str
    text: str
    is_last: bool = False


class BadReduction(ValueError):
    """A reduction that is none; the message says which."""


class MissingColumn(ValueError):
    """A run has no column of this name."""


def read(texts: Sequence[str]) -> tuple[Reduction, ...]:
    """The reductions of `--reduce NAME=EXPR`. Raises `BadReduction`."""
    found = []
    for text in texts:
        name, sign, written = (part.strip() for part in text.partition("="))
        if not sign or not name or not written:
            raise BadReduction(f"{LABEL} {text}: write NAME=EXPR, such as 'peak=max(abs(lambda.rod))'")
        found.append(Reduction(name, written))
    return tuple(found)


def of_last_row(columns: Sequence[str]) -> tuple[Reduction, ...]:
    """The last row of all columns but the time, which is `t_end`."""
    return tuple(Reduction(name, name, is_last=True) for name in columns if name != "t")


def check(reductions: Sequence[Reduction], columns: Sequence[str], parameters: Mapping[str, object]) -> None:
    """Raise `diagnostics.ModelError` where a reduction is wrong for a table of these columns."""
    found = diagnostics.Collector()
    rows = {name: np.ones(2) for name in columns}
    for one in reductions:
        if one.is_last:
            continue
        try:
            value(one, rows, np.array([0.0, 1.0]), parameters)
        except ExpressionError as error:
            where = yaml_tree.scalar(one.text, f"{LABEL} {one.name}").locate(error.start, error.end)
            found.add(diagnostics.Diagnostic(error.code, error.message, where, error.hint))
    found.raise_errors()


def columns_of(reduction: Reduction, known: Sequence[str]) -> tuple[str, ...]:
    """The columns it needs. Raises `MissingColumn`, and `ExpressionError` for a text that is none."""
    if reduction.is_last:
        if reduction.text not in known:
            raise MissingColumn(f"this run has no column `{reduction.text}`")
        return (reduction.text,)
    return columns_in(reduction.text, known)


def are_of_ends(reductions: Sequence[Reduction]) -> bool:
    """True where the first and the last row of a run are all they need."""
    others = set(_OF_ROWS) - {"first", "last"}
    return not any(others & tokens.called(one.text) for one in reductions if not one.is_last)


def value(
    reduction: Reduction, rows: Mapping[str, Floats], t: Floats, parameters: Mapping[str, object]
) -> float:
    """The number of a run with rows (T,) at t (T,); not finite where it has none. Raises `ExpressionError`."""
    if reduction.is_last:
        return float(rows[reduction.text][-1])
    node, found = _evaluated(reduction.text, rows, t, parameters)
    if np.ndim(found):
        message = "this is a column with a value for each row"
        raise ExpressionError("not-a-scalar", message, node.start, node.end, _HINT)
    return float(found)


def columns_in(text: str, known: Sequence[str]) -> tuple[str, ...]:
    """The columns that an expression names. Raises `ExpressionError` for a text that is none."""
    return tuple(dict.fromkeys(_tree(text, frozenset(known))[1].values()))


def at_rows(text: str, rows: Mapping[str, Floats], t: Floats, parameters: Mapping[str, object]) -> Floats:
    """The values (T,) of an expression of columns. Raises `ExpressionError`."""
    return np.broadcast_to(_evaluated(text, rows, t, parameters)[1], t.shape)


def _evaluated(
    text: str, rows: Mapping[str, Floats], t: Floats, parameters: Mapping[str, object]
) -> tuple[tree.Node, Array]:
    node, at = _tree(text, frozenset(rows))
    algebra = _RowAlgebra(text, {start: rows[name] for start, name in at.items()}, t, parameters)
    algebra.known = tuple(rows)
    with np.errstate(all="ignore"):  # a value that is not finite is reported as such
        return node, evaluate.scalar(node, algebra, REDUCERS)


@memory.remembered(256)
def _tree(text: str, known: frozenset[str]) -> tuple[tree.Node, dict[int, str]]:
    """The tree of a text with a plain word of its length for every column, and the columns by the places of these."""
    by_letter: dict[str, list[str]] = {}
    for name in sorted(known, key=len, reverse=True):
        by_letter.setdefault(name[:1], []).append(name)
    found: dict[int, str] = {}
    parts, at, is_inside = [], 0, False
    while at < len(text):
        names = () if is_inside else by_letter.get(text[at], ())
        name = ""
        for one in names:
            after = text[at + len(one) : at + len(one) + 1]
            if text.startswith(one, at) and after != "(" and not _PART_OF_NAME.match(after):
                name = one
                break
        if not name:
            is_inside = bool(re.match(r"[\w.]", text[at]))
            parts.append(text[at])
            at += 1
            continue
        found[at] = name
        parts.append("c" * len(name))
        at += len(name)
    return parser.parse("".join(parts)), found


def _time_of(pick: Callable[[Array], np.intp], x: Array, t: Array) -> float:
    return float("nan") if np.isnan(x).any() else float(t[pick(x)])


# Of a column x (T,) at the times t (T,). The two that the language has for several values at a time are among them.
_OF_ROWS: dict[str, Callable[[Array, Array], float]] = {
    "max": lambda x, t: float(x.max()),
    "min": lambda x, t: float(x.min()),
    "mean": lambda x, t: float(x.mean()),
    "rms": lambda x, t: float(np.sqrt(np.mean(x * x))),
    "first": lambda x, t: float(x[0]),
    "last": lambda x, t: float(x[-1]),
    "argmax": functools.partial(_time_of, np.argmax),
    "argmin": functools.partial(_time_of, np.argmin),
    "integral": lambda x, t: float(np.sum((x[1:] + x[:-1]) * np.diff(t)) / 2),
}
REDUCERS = frozenset(_OF_ROWS) - {"max", "min"}


class _RowAlgebra:
    """Arrays as scalars; see `evaluate.Algebra`."""

    known: tuple[str, ...] = ()

    def __init__(
        self, text: str, columns: Mapping[int, Floats], t: Floats, parameters: Mapping[str, object]
    ) -> None:
        self._text, self._columns, self._t, self._parameters = text, columns, t, parameters

    def number(self, node: tree.Number) -> Array:
        return np.float64(node.text)  # type: ignore[return-value]

    def operation(self, node: tree.Node, name: str, *parts: Array) -> Array:
        if name in _OF_ROWS and len(parts) == 1:
            return self._reduced(name, parts[0])
        if name == "pow":
            return np.power(*parts)
        made: Array = (functions.ARITHMETIC.get(name) or functions.TABLE[name].array)(*parts)
        return made

    def special(self, node: tree.Call) -> Value[Array]:
        if node.function not in REDUCERS:
            raise self._unknown(node.start, node.end)
        if len(node.arguments) != 1:
            message = f"`{node.function}` takes 1 argument, a column or an expression of columns"
            raise ExpressionError("wrong-arguments", message, node.start, node.end)
        return self._reduced(node.function, evaluate.scalar(node.arguments[0], self, REDUCERS))

    def atom(self, node: Reference) -> Value[Array]:
        if node.start in self._columns:
            return self._columns[node.start]
        found = self._parameters.get(node.name) if isinstance(node, tree.Name) else None
        if isinstance(node, tree.Member):
            vector = self._parameters.get(node.owner)
            if isinstance(vector, tuple) and node.member in evaluate.COMPONENTS:
                found = vector[evaluate.COMPONENTS.index(node.member)]
        if isinstance(found, tuple):
            x, y, z = (np.float64(part) for part in found)
            return x, y, z  # type: ignore[return-value]
        if isinstance(found, float):
            return np.float64(found)  # type: ignore[return-value]
        raise self._unknown(node.start, node.end)

    def _reduced(self, name: str, x: Array) -> Array:
        found = _OF_ROWS[name](np.broadcast_to(x, self._t.shape), self._t)
        return np.float64(found)  # type: ignore[return-value]

    def _unknown(self, start: int, end: int) -> ExpressionError:
        written = self._text[start:end]
        message = f"`{written}` is neither a column of the table nor a parameter"
        hint = diagnostics.nearest(written, (*self.known, *self._parameters))
        return ExpressionError("unknown-name", message, start, end, hint)
