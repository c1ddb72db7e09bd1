"""The steps of a run in native code: made for its functions once it pays, and bound to the arrays of the run.

The bits are those of the interpreter, so that a run may go over to native code at any step, and nothing of it is in the
state of a run. Where no code can be made the interpreter does it all.
"""

from __future__ import annotations

import ctypes
import functools
import itertools
import math
import threading
import time
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import NamedTuple

import casadi as ca
import numpy as np

from lagcli.arrays import Floats
from lagcli.native import machine_code, object_folder, paying
from lagcli.native.lowering import Module
from lagcli.native.machine_code import BEST, SOON, MachineCode
from lagcli.native.operations import Refusal
from lagcli.simulation import native_loop, native_rules
from lagcli.simulation.events.event import Event
from lagcli.simulation.native_loop import LoopText, Sizes
from lagcli.simulation.native_rules import Control
from lagcli.simulation.row_writer import RowWriter
from lagcli.simulation.scheme.bound_scheme import BoundStep
from lagcli.simulation.scheme.controller import NEARLY
from lagcli.simulation.scheme.controller import PARAMETERS as LENGTH
from lagcli.simulation.singularity.singularity_monitor import NEVER, Prediction, SingularityMonitor
from lagcli.simulation.stepping.stepper import Stepper

THREAD = "lagcli native code"


class Code(NamedTuple):
    """Code of some functions: its level, the numbers that it takes while it runs, and the functions of a table of
    addresses that it has."""

    level: int
    taken: int
    entries: dict[str, Callable[[ctypes.Array[ctypes.c_void_p]], None]]


ENTRIES = ("project", "step", "dense", "inside")
# The results of `NumericSystem.project` beside the motion.
PROJECTED = ("there", "rate_there", "status_there", "sizes_there")
DOUBLE = ctypes.sizeof(ctypes.c_double)
# Numbers that the loop itself makes.
LOOPS_OWN = ("reached", "grow", "uncut", "when")
# The name of the number in an object file that says what memory its functions take.
TAKEN = "taken"


class NativeFunctions:
    """Functions of runs, and their code once there is any; is_refused: there will be none."""

    def __init__(self, run: Stepper, multipliers: Sequence[int], clear: Sequence[ca.Function]) -> None:
        bound, rows, method = run.bound, run.trial.rows, run.method
        step = bound.staged.function
        functions: dict[str, ca.Function] = {
            "project": bound.scratch.function,
            "step": step,
            "dense": rows.dense.function,
            "inside": rows.inside.function,
            "plan": native_rules.plan(),
            "verdict": native_rules.verdict(run.trial.fewest, method.order, bound.enforced.is_any),
            "watched": native_rules.watched(),
            "foreseen": native_rules.foreseen(),
        }
        functions |= {f"clear{i}": each for i, each in enumerate(clear)}
        if multipliers:
            functions["pushes"] = native_rules.pushes(rows.line.size, multipliers)
        self._functions = functions
        stages = tuple(f"stage{i}" for i in range(step.n_out() - 3))
        arrays = {
            "project": ("there_t", "there_y", "p", *PROJECTED),
            "step": ("t", "h", "y", "k", "tolerance", "p", "new", "k_new", "status", *stages),
            "dense": ("t", "h", "y", "new", "k_new", "p", "k", *stages, "coefficients"),
            "inside": ("at", "x", "y", "coefficients", "p", "line"),
            "plan": ("t", "control", "is_over", "wished"),
            "verdict": (
                *("t", "h", "reached", "status", "grow", "control"),
                *("is_right", "smaller", "is_end", "grown", "is_coarse"),
            ),
            "watched": ("reached", "status", "control", "watch", "is_asked"),
            "foreseen": ("reached", "status", "control", "watch"),
            "pushes": ("line", "least_push"),
        }
        for i in range(len(clear)):
            arrays[f"clear{i}"] = ("when", "h", "y", "k", "new", "k_new", "p", f"clear{i}")
        self._arrays = {name: arrays[name] for name in functions}
        rules = [(name, each) for name, each in functions.items() if name not in ENTRIES]
        # Where arrays stand that the loop alone reads: results of the rules, and arguments that it makes itself.
        sizes = dict.fromkeys(LOOPS_OWN, 1) | {
            array: each.numel_out(i)
            for name, each in rules
            for i, array in enumerate(arrays[name][each.n_in() :])
        }
        self.own = dict(zip(sizes, itertools.accumulate(sizes.values(), initial=0), strict=False))
        self.own_size = sum(sizes.values())
        self.table = tuple(
            dict.fromkeys(["lines", "control", *LOOPS_OWN, *itertools.chain(*self._arrays.values())])
        )
        screens = tuple(each.numel_out(0) for each in clear)
        self._sizes = Sizes(
            bound.y.size, rows.line.size, method.evaluations, method.dense_evaluations, screens
        )
        self.code: Code | None = None
        self.is_refused, self._is_looked_for = not machine_code.is_installed(), False
        self._making: threading.Thread | None = None

    @cached_property
    def _loop(self) -> tuple[str, LoopText]:
        """The text of the loop and the entries, and what made it."""
        text = LoopText(self._arrays, self.table)
        return "\n".join([*map(text.entry, ENTRIES), text.loop(self._sizes)]), text

    @cached_property
    def _key(self) -> tuple[str, int]:
        """The name of the code in the folder, and the bytes that the functions take packed."""
        return machine_code.key(list(self._functions.values()), self._loop[0])

    @property
    def most(self) -> int:
        """Steps that the loop may take before it returns."""
        return paying.steps_at_once(self._key[1])

    def look(self, mode: str, steps: int) -> None:
        """Take the best code that is kept, and make it where it is asked for or after so many steps."""
        if self.is_refused or self._making is not None:
            return
        if self.code is None and not self._is_looked_for:
            self._is_looked_for = True
            for known in (BEST, SOON):
                kept = object_folder.read(f"{self._key[0]}-{known}")
                if kept is not None:
                    self._take(kept, known)
                    break
        level = -1 if self.code is None else self.code.level
        if mode == "always" and level < BEST:
            self._make(BEST)
        elif level < SOON and steps >= paying.PARAMETERS.soon:
            self._make(SOON)
        elif level == SOON and steps >= paying.PARAMETERS.best:
            # Steps go on meanwhile.
            self._making = threading.Thread(
                target=self._make_of, args=(self._text, BEST), name=THREAD, daemon=True
            )
            self._making.start()

    def _make(self, level: int) -> None:
        """Make code of a level and keep it."""
        try:
            text = self._text
        except Refusal:
            self.is_refused = True
        else:
            self._make_of(text, level)

    def _make_of(self, text: str, level: int) -> None:
        code = machine_code.made(text, level)
        object_folder.write(f"{self._key[0]}-{level}", code)
        self._take(code, level)

    @property
    def _text(self) -> str:
        module = Module()
        for name, function in self._functions.items():
            module.named(function, name)
        loop, text = self._loop
        module.declared |= text.declared
        taken = text.taken + max(module.taken.values())
        module.definitions += [loop, f"@{TAKEN} = constant i64 {taken}"]
        return module.text

    def _take(self, code: bytes, level: int) -> None:
        machine = MachineCode(code)
        names = {"loop": native_loop.LOOP, **{name: f"call_{name}" for name in ENTRIES}}
        entries = {name: machine.function(each) for name, each in names.items()}
        self.code = Code(level, machine.number(TAKEN), entries)


class NativeSteps:
    """The steps of one run, of which code takes as many as it may."""

    def __init__(self, run: Stepper, writer: RowWriter, events: Sequence[Event], mode: str) -> None:
        self._run, self._writer, self._events, self._mode = run, writer, events, mode
        self._bound: BoundStep | None = None
        self._code: Code | None = None
        self._control = np.zeros(native_rules.SIZE)
        self._looks_ahead = any(event.looks_ahead for event in events)

    def advance(self) -> None:
        """Take steps as long as they are ordinary ones; none where there is no code, or one is to be asked about."""
        run = self._run
        if self._bound is not run.bound:
            self._bind()
        functions = self._functions
        if functions.code is None or functions.code.level < BEST:
            began = time.perf_counter()
            functions.look(self._mode, run.bound.enforced.functions.steps)
            run.statistics.compile_seconds += time.perf_counter() - began
        if functions.code is not self._code:
            self._take(functions.code)
        is_ordinary = self._is_ordinary and run.longest == math.inf
        if self._code is not None and is_ordinary and all(screen.holds() for screen in self._screens):
            self._loop(self._code)

    def _bind(self) -> None:
        """Find the functions that the run has now."""
        run = self._run
        self._bound, self._code = run.bound, None
        screens = [event.screen() for event in self._events]
        self._screens = [screen for screen in screens if screen is not None]
        # Whether steps are no more than the loop makes of them.
        is_asked = len(self._screens) < len(screens) or run.has_turns
        self._is_ordinary = not (is_asked or run.bound.is_blurred or run.trial.rows.defect is not None)
        clear = [screen.function for screen in self._screens if screen.function is not None]
        question = "native", run.method.name, len(clear)
        self._reach = native_rules.reach(float(run.tolerance[0]), run.method.order)
        self._functions = run.bound.enforced.functions.memory.answer(
            question, lambda: NativeFunctions(run, self._writer.multipliers, clear)
        )

    def _take(self, code: Code | None) -> None:
        """Let the functions of the run be those of the code."""
        self._code = code
        if code is None:
            return
        bound, rows = self._run.bound, self._run.trial.rows
        t, h, y, k, tolerance, p = bound.arguments
        new, k_new, status, *stages = bound.staged.results
        arrays = {"t": t, "h": h, "y": y, "k": k, "tolerance": tolerance, "p": p, "control": self._control}
        arrays |= {"new": new, "k_new": k_new, "status": status, "coefficients": rows.dense.results[0]}
        arrays |= {f"stage{i}": stage for i, stage in enumerate(stages)}
        arrays |= {"at": rows.inside.arguments[0], "x": rows.inside.arguments[1], "line": rows.line}
        # The arrays of the loop alone, and behind them what functions take while they run.
        functions = self._functions
        self._memory = np.zeros(functions.own_size + code.taken)
        begin = _address(self._memory)
        addresses = {name: begin + DOUBLE * offset for name, offset in functions.own.items()}
        addresses |= {name: _address(array) for name, array in arrays.items()}
        table = [addresses.get(name, 0) for name in functions.table]
        work = begin + DOUBLE * functions.own_size
        self._table = (ctypes.c_void_p * (1 + len(table)))(work, *table)
        self._projects = False
        for name, function in (
            *(("step", bound.step), ("step", bound.staged)),
            *(("dense", rows.dense), ("inside", rows.inside)),
        ):
            function.trigger = functools.partial(code.entries[name], self._table)

    def _project(self, code: Code) -> None:
        """Let the projection beside the motion be that of the code too."""
        self._projects, scratch = True, self._run.bound.scratch
        arrays = {"there_t": scratch.arguments[0], "there_y": scratch.arguments[1]}
        arrays |= dict(zip(PROJECTED, scratch.results, strict=True))
        for name, array in arrays.items():
            self._table[1 + self._functions.table.index(name)] = _address(array)
        scratch.trigger = functools.partial(code.entries["project"], self._table)

    def _loop(self, code: Code) -> None:
        """Go on in the loop, and take over where it ends."""
        run, writer, grid, control = self._run, self._writer, self._writer.grid, self._control
        statistics = run.statistics
        most = min(self._functions.most, LENGTH.pace - 1 - statistics.steps % LENGTH.pace)
        rows = writer.next_row, run.row_time, writer.last, writer.begun, writer.filled
        read = grid.end, run.origin, grid.start, grid.step, grid.count - 1, writer.capacity, most
        last = (
            run.contacts.deepest,
            NEARLY if self._looks_ahead else 0.0,
            *self._reach,
            *run.timetable.free(run.t),
        )
        seen = run.watch.seen or native_rules.UNSEEN
        control[:] = run.control.step, *seen, *run.watch.foreseen, *rows, 0, 0, 0, *read, *last
        self._table[1] = _address(writer.lines)
        code.entries["loop"](self._table)
        steps = int(control[Control.STEPS])
        if not steps:
            return
        step, *watch, next_row, row_time, last, begun, filled = control[: Control.STEPS].tolist()
        run.t, run.control.step = run.bound.t[0], step
        instant, component, *rest = watch[4:]
        foreseen = Prediction(instant, int(component), *rest) if instant < math.inf else NEVER
        seen = () if watch[0] == math.inf else tuple(watch[:4])
        run.watch = SingularityMonitor(seen, foreseen)
        if foreseen is not NEVER and not self._projects:
            self._project(code)  # which a step across asks for thousands of times
        writer.next_row, run.row_time, writer.last = int(next_row), row_time, last
        writer.begun, writer.filled = begun, int(filled)
        statistics.steps += steps
        statistics.rejected += int(control[Control.REJECTED])
        statistics.evaluations += int(control[Control.EVALUATIONS])
        statistics.native_steps += steps
        run.bound.enforced.functions.steps += steps
        run.settle()


def _address(array: Floats) -> int:
    """Where the numbers of an array stand; numpy takes three times as long to say it."""
    if not array.size:
        return 0
    # What lies in memory in another order, or in pieces, is refused here.
    memory = array.data if array.flags.c_contiguous else array.T.data
    return ctypes.addressof(ctypes.c_double.from_buffer(memory))
