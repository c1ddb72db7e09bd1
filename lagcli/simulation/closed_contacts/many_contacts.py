"""The numbers of contacts that are too many to ask for all that is known of each: of those that are near, and others.

Gaps, and what counts as closed, are made of all contacts of a kind at once; the rest only of contacts that are nearly
closed, and of those that are asked for.
"""

from __future__ import annotations

import numpy as np

from lagcli.arrays import Floats, Indices
from lagcli.compiled import contact_kinds
from lagcli.compiled.bound_function import BoundFunction
from lagcli.compiled.column_program import ColumnProgram
from lagcli.compiled.contact_values import COLUMNS, ContactValues, MotionNumbers

GAP, TOUCHING = COLUMNS.index("g"), COLUMNS.index("touching_gap")


class ManyContacts:
    """Contacts of the kinds of a system; `arguments`: t, q, v, p and what is chosen, in memory that is shared."""

    def __init__(self, values: ContactValues, arguments: list[Floats]) -> None:
        t, self._q, self._v, p, chosen = arguments
        self._motion = BoundFunction(values.motion, arguments)
        of_motion, self._units = np.zeros(len(self._motion.results) - 1), self._motion.results[0]
        self._kinds, self._of_motion = values.kinds, of_motion
        self._gaps, self._near, self._one = [], [], []
        for kind, function in zip(values.kinds, values.of_kinds, strict=True):
            m, k = kind.coordinates.shape[1], kind.members.size
            local = [np.zeros(m) for _ in range(3)]
            self._one.append(
                (BoundFunction(function, [t, *local[:2], p, chosen, local[2], of_motion]), local)
            )
            of_all = [np.zeros((m, k)) for _ in range(3)]
            given = [t, *of_all[:2], p, chosen, of_all[2], of_motion]
            given = [each if each.ndim > 1 else each.reshape(-1, 1) for each in given]
            program = ColumnProgram(function)
            self._gaps.append((program.bound(given, (GAP,)), of_all[:1]))
            self._near.append((program.bound(given, (GAP, TOUCHING)), of_all))
        self._places = [np.ascontiguousarray(kind.coordinates.T) for kind in values.kinds]
        count = sum(kind.members.size for kind in values.kinds)
        # The kind of each contact, and its number among those of the kind.
        self._kind, self._member = np.zeros((2, count), dtype=np.intp)
        for number, kind in enumerate(values.kinds):
            self._kind[kind.members], self._member[kind.members] = number, np.arange(kind.members.size)

    def at(self, asked: Indices, closely: float) -> tuple[Floats, Indices, Floats, Floats, MotionNumbers]:
        """At the arguments: the `COLUMNS` (11, K), of which gaps and what counts as closed are of all; the contacts
        that all columns are of: those asked for and those whose gaps are not above so many times what counts as closed;
        their entries of G, one contact after the other; the units (n,), and the numbers of the motion. Where closely is
        0 they are those that are not open, and what counts as closed is of them alone."""
        self._motion.trigger()
        self._of_motion[:] = [float(each[0]) for each in self._motion.results[1:]]
        columns = np.full((len(COLUMNS), self._kind.size), np.nan)
        programs, made = (self._near, (GAP, TOUCHING)) if closely else (self._gaps, (GAP,))
        for (program, of_all), places, kind in zip(programs, self._places, self._kinds, strict=True):
            for source, target in zip((self._q, self._v, self._units), of_all, strict=False):
                np.take(source, places, out=target, mode="clip")
            for column, found in zip(made, program.run(), strict=True):
                columns[column, kind.members] = found
        least = closely * columns[TOUCHING] if closely else 0.0
        is_near = ~(columns[GAP] > least)
        is_near[asked] = True
        looked, entries = np.flatnonzero(is_near), [np.zeros(0)]
        for j, number, member in zip(
            looked.tolist(), self._kind[looked].tolist(), self._member[looked].tolist(), strict=True
        ):
            bound, (q, v, units) = self._one[number]
            coordinates = self._kinds[number].coordinates[member]
            q[:], v[:], units[:] = self._q[coordinates], self._v[coordinates], self._units[coordinates]
            bound.trigger()
            columns[:, j] = bound.results[0][: len(COLUMNS)]
            entries.append(bound.results[0][len(COLUMNS) :].copy())
        motion = MotionNumbers(*self._of_motion[:-1].tolist())
        return columns, looked, np.concatenate(entries), self._units.copy(), motion


def are_some(values: ContactValues, count: int) -> bool:
    """True where there are so many contacts, of kinds that allow it."""
    return count > contact_kinds.PARAMETERS.many and all(
        ColumnProgram(each).is_whole for each in values.of_kinds
    )
