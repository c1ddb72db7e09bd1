"""The loop over ordinary steps as text of LLVM: it tries a step, judges it, writes the rows in it and goes to its end.

It returns in front of a step in which anything else is to be done, and leaves everything as it was there. It follows
`Stepper`, `StepTrial` and `RowWriter` line by line; the arithmetic of step lengths is that of `native_rules`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from lagcli import doubles
from lagcli.native.instructions import Body
from lagcli.native.operations import literal
from lagcli.simulation.native_rules import Control
from lagcli.simulation.scheme.controller import PARAMETERS as LENGTH

LOOP = "loop"
ZERO, ONE, INFINITY = map(literal, (0.0, 1.0, math.inf))
# What stands in the memory of the loop and not in that of its caller until the step is taken.
KEPT = (
    Control.ROW,
    Control.ROW_TIME,
    Control.FILLED,
    Control.LAST_ROW,
    Control.REJECTED,
    Control.EVALUATIONS,
)


class Sizes(NamedTuple):
    """state: numbers of a state; line: of a line of the table; evaluations, dense_evaluations: as `Method` has them;
    screens: the results of each function that tells whether a step is clear."""

    state: int
    line: int
    evaluations: int
    dense_evaluations: int
    screens: tuple[int, ...]


class LoopText:
    """The text, and that of functions that call one of its own alone.

    functions: those that it calls, with the arrays of their arguments and results by name; arrays: the names of all, in
    the order of the table of addresses that is the argument, behind memory for all functions. taken: the numbers of
    that which the text itself takes.
    """

    def __init__(self, functions: Mapping[str, Sequence[str]], arrays: Sequence[str]) -> None:
        self._functions, self._arrays, self.declared = functions, arrays, set[str]()
        self.taken = 0

    def entry(self, name: str) -> str:
        """A function of the table that calls one of the functions: its text."""
        self._begin()
        self._call(name)
        return self._definition(f"call_{name}")

    def loop(self, sizes: Sizes) -> str:
        """The loop: its text."""
        self._begin()
        body, get, put = self._body, self._get, self._put
        self._kept = {place: body.room(1) for place in KEPT}
        length = body.room(1)

        body.label("next")
        body.go_if("oge", get(Control.STEPS), get(Control.MOST), "done")
        self._call("plan")
        body.go_if("une", get("is_over"), ZERO, "done")
        # As `Stepper` cuts a step: the one behind it is as long as was wished, if the error of this one lets it be.
        wished, longest = get("wished"), get(Control.LONGEST)
        body.store(self._chosen("ogt", wished, longest, longest, wished), length, 0)
        put(self._chosen("ogt", wished, longest, wished, ZERO), "uncut")
        put(literal(LENGTH.grow), "grow")
        for place in KEPT:
            body.store(get(place), self._kept[place], 0)

        body.label("try")
        t, h = get("t"), body.load(length, 0)
        reached = self._of("fadd", t, h)
        taken = self._of("fsub", reached, t)
        body.go_if("ule", taken, ZERO, "done")
        body.go_if("uge", reached, get(Control.FREE), "done")
        left = self._of("fsub", get(Control.END), reached)
        body.go_if("ule", left, ZERO, "done")
        body.go_if("ult", left, self._of("fmul", literal(doubles.VALUE), h), "done")
        put(taken, "h")
        put(reached, "reached")
        self._call("step")
        self._add(Control.EVALUATIONS, sizes.evaluations)
        self._call("verdict")
        body.go_if("une", get("is_right"), ZERO, "right")
        body.go_if("une", get("is_end"), ZERO, "done")
        self._add(Control.REJECTED, 1)
        put(ONE, "grow")
        put(ZERO, "uncut")
        body.store(get("smaller"), length, 0)
        body.go("try", "right")
        body.go_if("une", get("is_coarse"), ZERO, "done")
        put(self._of("fadd", get(Control.ORIGIN), t), "when")
        for i, size in enumerate(sizes.screens):
            self._call(f"clear{i}")
            body.go_if("ule", get(f"clear{i}"), ZERO, "done")
            if size > 1:
                body.go_if("ugt", get(f"clear{i}", 1), get(Control.DEEPEST), "done")
        self._add_rows(t, reached, taken, sizes)

        self._call("watched")
        body.go_if("oeq", get("is_asked"), ZERO, "seen")
        self._call("foreseen")
        body.label("seen")
        body.copy(
            self._at["watch"], body.address(self._at["control"], Control.SEEN), Control.ROW - Control.SEEN
        )
        for place in KEPT:
            put(body.load(self._kept[place], 0), place)
        put(t, Control.BEGUN)
        grown, uncut = get("grown"), get("uncut")
        put(self._chosen("ogt", uncut, grown, uncut, grown), Control.STEP)
        put(self._of("fadd", get(Control.STEPS), ONE), Control.STEPS)
        put(reached, "t")
        body.copy(self._at["new"], self._at["y"], sizes.state)
        body.copy(self._at["k_new"], self._at["k"], sizes.state)
        body.go("next", "done")
        return self._definition(LOOP)

    def _add_rows(self, t: str, reached: str, taken: str, sizes: Sizes) -> None:
        """The rows within a step, if the block has room for all of them: see `RowWriter.put_rows`."""
        body, get, put, kept = self._body, self._get, self._put, self._kept
        body.go_if("oge", body.load(kept[Control.ROW_TIME], 0), reached, "behind_rows")
        self._call("dense")
        self._add(Control.EVALUATIONS, sizes.dense_evaluations)
        body.label("row")
        time = body.load(kept[Control.ROW_TIME], 0)
        body.go_if("oge", time, reached, "behind_rows")
        filled = body.load(kept[Control.FILLED], 0)
        body.go_if("oge", filled, get(Control.CAPACITY), "done")
        put(self._of("fadd", get(Control.ORIGIN), time), "at")
        put(self._of("fdiv", self._of("fsub", time, t), taken), "x")
        self._call("inside")
        total = body.called("llvm.fabs.f64", get("line", sizes.line - 1))
        body.go_if("uge", total, INFINITY, "done")  # it is not finite
        if "pushes" in self._functions:
            self._call("pushes")
            body.go_if("ult", get("least_push"), ZERO, "done")
        begin = body.value(f"fptoui double {filled} to i64")
        begin = body.value(f"mul i64 {begin}, {sizes.line}")
        body.copy(self._at["line"], body.address(self._at["lines"], begin), sizes.line)
        self._add(Control.FILLED, 1)
        self._add(Control.ROW, 1)
        body.store(time, kept[Control.LAST_ROW], 0)
        # As `Grid.time`.
        row = body.load(kept[Control.ROW], 0)
        start, step, last = (get(Control.GRID, i) for i in range(3))
        later = self._of("fadd", start, self._of("fmul", row, step))
        later = self._chosen("oeq", row, last, get(Control.END), later)
        later = self._chosen("ogt", row, last, INFINITY, later)
        body.store(later, kept[Control.ROW_TIME], 0)
        body.go("row", "behind_rows")
        # A row at the end of a step is not one of its dense output.
        body.go_if("oeq", body.load(kept[Control.ROW_TIME], 0), reached, "done")

    def _begin(self) -> None:
        self._body = body = Body(self.declared)
        self._at = {}
        for i, name in enumerate(self._arrays, start=1):
            place = body.value(f"getelementptr inbounds ptr, ptr %table, i64 {i}")
            self._at[name] = body.value(f"load ptr, ptr {place}, align 8")

    def _definition(self, name: str) -> str:
        self.taken = max(self.taken, self._body.taken)
        return self._body.definition(name, "ptr noalias %table", "\n  %work = load ptr, ptr %table, align 8")

    def _call(self, name: str) -> None:
        arrays = ", ".join(f"ptr {self._at[array]}" for array in self._functions[name])
        self._body.add(f"call void @{name}({arrays}, ptr %deeper)")

    def _get(self, place: Control | str, index: int = 0) -> str:
        """A number of the shared memory, or of an array."""
        if isinstance(place, Control):
            return self._body.load(self._at["control"], int(place) + index)
        return self._body.load(self._at[place], index)

    def _put(self, number: str, place: Control | str) -> None:
        if isinstance(place, Control):
            self._body.store(number, self._at["control"], int(place))
        else:
            self._body.store(number, self._at[place], 0)

    def _of(self, operation: str, a: str, b: str) -> str:
        return self._body.value(f"{operation} double {a}, {b}")

    def _chosen(self, predicate: str, a: str, b: str, if_true: str, if_false: str) -> str:
        is_true = self._body.value(f"fcmp {predicate} double {a}, {b}")
        return self._body.value(f"select i1 {is_true}, double {if_true}, double {if_false}")

    def _add(self, place: Control, number: int) -> None:
        kept = self._kept[place]
        self._body.store(self._of("fadd", self._body.load(kept, 0), literal(float(number))), kept, 0)
