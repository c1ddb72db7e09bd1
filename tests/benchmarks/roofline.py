"""How near steps come to what one core can do: operations counted, time measured, and the peaks of the core.

Operations are those of doubles in the instructions of the function of a step: + - * / and roots, and a mathematical
function as one.
"""

from __future__ import annotations

import ctypes
import math
import time
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

import lagcli
from lagcli.api import cache
from lagcli.model.settings import Simulation
from lagcli.native import machine_code, operations
from lagcli.simulation.scheme import method

from . import cases

NONE, LONGER = 1e-9, 20  # times the duration of a case: a call of no steps, and one in which they count
TIERS = {"plain": "never", "native": "always"}
NAMES = {
    "ADD",
    "SUB",
    "MUL",
    "DIV",
    "SQ",
    "TWICE",
    "INV",
    "SQRT",
    "POW",
    "CONSTPOW",
    "SIN",
    "COS",
    "TAN",
    "ASIN",
}
NAMES |= {"ACOS", "ATAN", "ATAN2", "SINH", "COSH", "TANH", "EXP", "LOG", "HYPOT"}
OPERATIONS = {f"OP_{name}" for name in NAMES}

# The peak of code like that of the native tier: numbers one by one, products and sums apart. So many sums at once fill
# the units of a core and its registers.
AT_ONCE, TURNS = 12, 10**7
SQUARE = 512  # of the matrices whose product gives the peak of all units


def operations_of(function: ca.Function) -> int:
    """Operations on doubles of one call."""
    if function.class_name() == "Map":
        return int(function.info()["n"]) * operations_of(function.info()["f"])
    count, is_graph = 0, function.is_a("MXFunction")
    for k in range(function.n_instructions()):
        name = operations.NAMES[function.instruction_id(k)]
        if not is_graph:
            count += name in OPERATIONS
            continue
        node = function.instruction_MX(k)
        if name == "OP_CALL":
            count += operations_of(node.which_function())
        elif name == "OP_MTIMES":
            count += 2 * node.dep(1).nnz() * node.size2()
        elif name == "OP_DOT":
            count += 2 * node.dep(0).nnz()
        elif name in OPERATIONS:
            count += node.nnz()
    return count


def _least(call: Callable[[], object], count: int = 5) -> float:
    times = []
    for _ in range(count):
        began = time.process_time()
        call()
        times.append(time.process_time() - began)
    return min(times)


def scalar_peak() -> float | None:
    """Operations a second of one core, one by one, products and sums apart; None without llvmlite."""
    if not machine_code.is_installed():
        return None
    sums, text = range(AT_ONCE), ["define void @peak(ptr %table) {", "entry:", "  br label %loop", "loop:"]
    text.append(f"  %k = phi i64 [ {TURNS}, %entry ], [ %less, %loop ]")
    text += [f"  %x{i} = phi double [ {float(i)}, %entry ], [ %s{i}, %loop ]" for i in sums]
    text += [f"  %p{i} = fmul double %x{i}, {operations.literal(0.9)}" for i in sums]
    text += [f"  %s{i} = fadd double %p{i}, {operations.literal(0.1)}" for i in sums]
    text += ["  %less = sub i64 %k, 1", "  %over = icmp eq i64 %less, 0"]
    text += ["  br i1 %over, label %done, label %loop", "done:", "  %a0 = fadd double %s0, 0.0"]
    text += [f"  %a{i} = fadd double %a{i - 1}, %s{i}" for i in sums if i]
    text += ["  %to = load ptr, ptr %table", f"  store double %a{AT_ONCE - 1}, ptr %to", "  ret void", "}"]
    peak = machine_code.MachineCode(machine_code.made("\n".join(text), machine_code.BEST)).function("peak")
    total = np.zeros(1)
    table = (ctypes.c_void_p * 1)(total.ctypes.data)
    return 2 * AT_ONCE * TURNS / _least(lambda: peak(table))


def matrix_peak() -> float:
    """Operations a second of one core in a product of matrices: all units, products and sums fused."""
    A = np.random.default_rng(1).random((SQUARE, SQUARE))
    return 2 * SQUARE**3 / _least(lambda: A @ A)


def measured(case: cases.Case, rtol: float, rounds: int) -> dict[str, Any]:
    """Operations of a tried step of a case, how many are tried with a tolerance, and seconds of one in each tier.

    What a step takes is seen in a longer motion: a call less one of no steps, over the tries.
    """
    model = lagcli.loads(case.problem["model"])
    scheme = cache.compiled(model).cached.plain.scheme(method.of(Simulation(rtol=rtol)))
    line: dict[str, Any] = {"case": case.name, "operations": operations_of(scheme.step), "rtol": rtol}
    tiers = TIERS if machine_code.is_installed() else {"plain": "never"}

    def call(tier: str, share: float) -> tuple[float, int]:
        duration, mode = share * case.problem["duration"], tiers[tier]
        began = time.process_time()
        run = lagcli.simulate(model, duration=duration, samples=2, rtol=rtol, atol=rtol / 100, compile=mode)
        return time.process_time() - began, run.stats.steps + run.stats.rejected

    line["tries"] = call("plain", 1.0)[1]
    best = {tier: [(math.inf, 0), (math.inf, 0)] for tier in tiers}
    for _ in range(2 * rounds):
        for tier, least in best.items():
            least[:] = min(least[0], call(tier, NONE)), min(least[1], call(tier, LONGER))
    for tier, ((none, few), (long, many)) in best.items():
        line[tier] = (long - none) / (many - few)
    return line
