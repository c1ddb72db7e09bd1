"""Native code gives the bits of CasADi's interpreter, operation by operation; what it has no row for is refused."""

from __future__ import annotations

import ctypes
import itertools
import math
import threading

import casadi as ca
import numpy as np
import pytest

pytest.importorskip("llvmlite")

from lagcli.native import lowering, machine_code, operations
from lagcli.native.lowering import Module
from lagcli.native.machine_code import BEST, SOON, MachineCode
from lagcli.native.operations import Refusal

NUMBERS = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    0.5,
    2.0,
    3.0,
    1e-300,
    1e300,
    5e-324,
    math.inf,
    -math.inf,
    math.nan,
    0.1,
    -7.3,
]


class Native:
    """A function by native code: called with arguments, it gives all results."""

    def __init__(self, function, level=SOON):
        module = Module()
        name, self._function = module.named(function), function
        self._work = np.full(module.taken[name], math.nan)
        count = function.n_in() + function.n_out() + 1
        loads = [
            f"  %s{i} = getelementptr ptr, ptr %table, i64 {i}\n  %a{i} = load ptr, ptr %s{i}"
            for i in range(count)
        ]
        passed = ", ".join(f"ptr %a{i}" for i in range(count))
        call = [f"  call void @{name}({passed})", "  ret void", "}"]
        module.definitions.append("\n".join(["define void @entry(ptr %table) {", *loads, *call]))
        self._entry = MachineCode(machine_code.made(module.text, level)).function("entry")

    def __call__(self, arguments):
        function = self._function
        arrays = [np.array(argument, dtype=float).ravel(order="F") for argument in arguments]
        results = [np.full(max(1, function.nnz_out(i)), 77.0) for i in range(function.n_out())]
        table = [array.ctypes.data for array in (*arrays, *results, self._work)]
        self._entry((ctypes.c_void_p * len(table))(*table))
        return [result[: function.nnz_out(i)] for i, result in enumerate(results)]


def require_same_bits(function, inputs, level=SOON):
    """Hold native code against the interpreter for each of some lists of arguments."""
    native = Native(function, level)
    for arguments in inputs:
        plain = function.call([ca.DM(np.asarray(argument, dtype=float)) for argument in arguments])
        for i, (result, expected) in enumerate(zip(native(arguments), plain, strict=True)):
            expected = np.array(expected.nonzeros())
            is_none = np.isnan(result) & np.isnan(expected)  # which of many nan it is nobody asks
            same = is_none | (result.view(np.int64) == expected.view(np.int64))
            assert same.all(), (i, arguments, result, expected)


UNARY = {
    "neg": lambda x: -x, "sq": lambda x: x**2, "twice": lambda x: 2 * x, "inv": lambda x: 1 / x, "sqrt": ca.sqrt,
    "sin": ca.sin, "cos": ca.cos, "tan": ca.tan, "asin": ca.asin, "acos": ca.acos, "atan": ca.atan, "sinh": ca.sinh,
    "cosh": ca.cosh, "tanh": ca.tanh, "asinh": ca.asinh, "acosh": ca.acosh, "atanh": ca.atanh, "exp": ca.exp,
    "log": ca.log, "log1p": ca.log1p, "expm1": ca.expm1, "erf": ca.erf, "fabs": ca.fabs, "floor": ca.floor,
    "ceil": ca.ceil, "sign": ca.sign, "not": ca.logic_not, "cube": lambda x: x**3, "root": lambda x: x**0.3,
}  # fmt: skip
BINARY = {
    "add": lambda x, y: x + y, "sub": lambda x, y: x - y, "mul": lambda x, y: x * y, "div": lambda x, y: x / y,
    "pow": lambda x, y: x**y, "fmin": ca.fmin, "fmax": ca.fmax, "atan2": ca.atan2, "hypot": ca.hypot, "fmod": ca.fmod,
    "lt": lambda x, y: x < y, "le": lambda x, y: x <= y, "eq": lambda x, y: x == y, "ne": lambda x, y: x != y,
    "and": ca.logic_and, "or": ca.logic_or, "copysign": ca.copysign, "if_else": lambda x, y: ca.if_else(x > 0, y, 3),
}  # fmt: skip


@pytest.mark.numeric
@pytest.mark.parametrize("sort", [ca.SX, ca.MX])
def test_every_operation_has_the_bits_of_the_interpreter_also_beside_the_numbers(sort):
    x, y = sort.sym("x"), sort.sym("y")
    outputs = [make(x) for make in UNARY.values()] + [make(x, y) for make in BINARY.values()]
    function = ca.Function("f", [x, y], [ca.densify(output) for output in outputs])
    near = (np.random.default_rng(1).normal(size=(300, 2)) * 3).tolist()
    require_same_bits(function, [*itertools.product(NUMBERS, NUMBERS), *near])


@pytest.mark.parametrize("level", [SOON, BEST])
def test_sums_are_neither_reordered_nor_contracted(level):
    x = ca.SX.sym("x", 40)
    total = ca.SX(0)
    for i in range(40):
        total = total + x[i] * x[39 - i]
    function = ca.Function("f", [x], [total, total * total - x[0] * x[39]])
    numbers = [[np.random.default_rng(seed).normal(size=40) * 10.0**seed] for seed in range(5)]
    require_same_bits(function, numbers, level)


def test_a_product_and_a_sum_are_rounded_one_by_one_in_columns_too():
    x, y, z = (ca.MX.sym(name, 9) for name in "xyz")
    function = ca.Function("f", [x, y, z], [x * y + z, x * y - z, z - x * y])
    numbers = [np.random.default_rng(seed).normal(size=(3, 9)) for seed in range(20)]
    # The sum is what rounding leaves of the product.
    inputs = [(a, b, -a * b) for a, b, _ in numbers] + [tuple(each) for each in numbers]
    require_same_bits(function, inputs, BEST)


def test_graphs_of_columns_matrices_and_calls_have_the_bits_of_the_interpreter():
    a, b = ca.SX.sym("a", 3), ca.SX.sym("b", 2)
    inner = ca.Function("inner", [a, b], [ca.vertcat(a[0] * b, a[1:]), ca.sum1(a)])
    x, y, s = ca.MX.sym("x", 3), ca.MX.sym("y", 2), ca.MX.sym("s")
    first, second = inner(x, y)
    again, _ = inner(first[:3], y * s)
    square = ca.reshape(ca.vertcat(first, again, s), 3, 3)
    outputs = [
        square,
        ca.mtimes(square, x),
        ca.vertcat(second, ca.mmax(first), ca.mmin(again)),
        ca.vec(square)[::-1],
        ca.project(ca.diag(x), ca.Sparsity.dense(3, 3)),
        ca.horzcat(x, first[:3] + 2.0, x * s),
    ]
    generators = [np.random.default_rng(seed) for seed in range(3)]
    numbers = [[generator.normal(size=size) for size in (3, 2, 1)] for generator in generators]
    require_same_bits(ca.Function("outer", [x, y, s], outputs), numbers)


def test_a_register_that_is_taken_again_holds_what_is_read_last():
    x = ca.MX.sym("x", 6)
    value = x
    for i in range(30):
        value = ca.vertcat(value[3:], value[:3]) * 1.01 + ca.sin(value) * (0.1 * i)
    require_same_bits(ca.Function("f", [x], [value, ca.reshape(value, 2, 3)]), [[np.arange(6.0) - 2.5]])


def test_what_has_no_row_is_refused_by_its_name():
    A, b = ca.MX.sym("A", 3, 3), ca.MX.sym("b", 3)
    with pytest.raises(Refusal, match="OP_SOLVE"):
        Module().named(ca.Function("f", [A, b], [ca.solve(A, b)]))


def test_a_number_is_written_by_its_bits():
    assert operations.literal(1.0) == "0x3FF0000000000000"
    assert operations.literal(-0.0) == "0x8000000000000000"


def test_a_function_in_parts_has_the_bits_of_a_whole_one_and_a_bounded_stack(monkeypatch):
    monkeypatch.setattr(lowering, "LONGEST_WHOLE", 2**10)
    x = ca.SX.sym("x", 20)
    numbers = [x[i] for i in range(20)]
    for _ in range(6_000):
        numbers.append(numbers[-1] * numbers[-20] + numbers[-7])
    function = ca.Function("f", [x], [ca.vertcat(*numbers[-20:]), ca.vertcat(*numbers[::100])])
    given = [[np.random.default_rng(seed).uniform(-0.5, 0.5, size=20)] for seed in range(3)]
    failures = []

    def compared():
        try:
            require_same_bits(function, given)
        except AssertionError as failure:
            failures.append(failure)

    before = threading.stack_size(2**19)  # as threads of macOS
    try:
        thread = threading.Thread(target=compared)
        thread.start()
        thread.join()
    finally:
        threading.stack_size(before)
    assert not failures


def test_what_several_operations_do_to_each_entry_has_the_bits_of_the_interpreter():
    for size in (1, 2, 3, 4, 5, 7, 8, 9, 21):
        x, y, s = ca.MX.sym("x", size), ca.MX.sym("y", size), ca.MX.sym("s")
        total = x
        for i in range(6):
            total = (total * (0.1 * i - s) + y / 3.0) * -(x**2) + 2 * total
        shared = total - y
        outputs = [total, shared, shared[1:] * shared[:-1], ca.sin(total) + x, ca.vertcat(shared, s), s + 1]
        numbers = [np.random.default_rng(size).normal(size=each) for each in (size, size, 1)]
        require_same_bits(ca.Function("f", [x, y, s], outputs), [numbers])
