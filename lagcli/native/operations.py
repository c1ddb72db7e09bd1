"""The operations of CasADi as instructions of LLVM: one table, and what is not in it is refused.

The contract is bits: each row computes what CasADi's own interpreter computes for the operation, in doubles, by
IEEE 754 where that decides and by the C library of the process elsewhere, which CasADi calls too. So nothing is
contracted, reordered or approximated.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from functools import cache
from typing import Protocol

import casadi as ca

from lagcli.smoothness.sized_function import SizedFunction

# OP_ADD, OP_SIN, ... by their numbers in CasADi, which may differ between its versions.
NAMES: dict[int, str] = {getattr(ca, name): name for name in dir(ca) if name.startswith("OP_")}


class Refusal(Exception):
    """An operation that has no native code; the plain tier computes it."""


class Lines(Protocol):
    """A list of instructions that grows, about numbers of one kind."""

    kind: str

    def value(self, instruction: str) -> str:
        """Add an instruction, and return the name of its result."""

    def called(self, name: str, *arguments: str) -> str:
        """Add a call of a function of doubles, and return the name of its result."""


Row = Callable[..., str]


def literal(number: float) -> str:
    """A double, by its bits."""
    (bits,) = struct.unpack(">Q", struct.pack(">d", number))
    return f"0x{bits:016X}"


def _instruction(name: str) -> Row:
    return lambda to, a, b: to.value(f"{name} {to.kind} {a}, {b}")


def _library(name: str) -> Row:
    return lambda to, *arguments: to.called(name, *arguments)


def _flag(to: Lines, condition: str) -> str:
    return to.value(f"select i1 {condition}, double 1.0, double 0.0")


def _comparison(predicate: str) -> Row:
    return lambda to, a, b: _flag(to, to.value(f"fcmp {predicate} double {a}, {b}"))


def _both(to: Lines, a: str, b: str, joined: str) -> str:
    is_a, is_b = (to.value(f"fcmp une double {each}, 0.0") for each in (a, b))
    return _flag(to, to.value(f"{joined} i1 {is_a}, {is_b}"))


@cache
def _takes_first(name: str) -> bool:
    """True if CasADi's fmin or fmax (of zeros with two signs) gives the first of equal numbers, as some builds do."""
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    return math.copysign(1.0, SizedFunction("f", [x, y], [getattr(ca, name)(x, y)])(-0.0, 0.0)) < 0


def _extreme(name: str, predicate: str) -> Row:
    """Fmin or fmax: a number where one of both is none."""

    def row(to: Lines, a: str, b: str) -> str:
        first, second = (a, b) if _takes_first(name) else (b, a)
        is_second = to.value(f"fcmp {predicate} double {second}, {first}")
        of_numbers = to.value(f"select i1 {is_second}, double {second}, double {first}")
        is_none = to.value(f"fcmp uno double {first}, {first}")
        return to.value(f"select i1 {is_none}, double {second}, double {of_numbers}")

    return row


def _sign(to: Lines, a: str) -> str:
    """-1, 1, or the zero or nan that it is."""
    is_below, is_above = (to.value(f"fcmp {way} double {a}, 0.0") for way in ("olt", "ogt"))
    up = to.value(f"select i1 {is_above}, double 1.0, double {a}")
    return to.value(f"select i1 {is_below}, double -1.0, double {up}")


def _chosen(to: Lines, condition: str, a: str) -> str:
    is_true = to.value(f"fcmp une double {condition}, 0.0")
    return to.value(f"select i1 {is_true}, double {a}, double 0.0")


ROWS: dict[str, Row] = {
    "OP_ASSIGN": lambda to, a: a,
    "OP_ADD": _instruction("fadd"),
    "OP_SUB": _instruction("fsub"),
    "OP_MUL": _instruction("fmul"),
    "OP_DIV": _instruction("fdiv"),
    "OP_NEG": lambda to, a: to.value(f"fneg {to.kind} {a}"),
    "OP_SQ": lambda to, a: to.value(f"fmul {to.kind} {a}, {a}"),
    "OP_TWICE": lambda to, a: to.value(f"fadd {to.kind} {a}, {a}"),
    "OP_INV": lambda to, a: to.value(f"fdiv double {literal(1.0)}, {a}"),
    "OP_SQRT": _library("llvm.sqrt.f64"),
    "OP_FABS": _library("llvm.fabs.f64"),
    "OP_FLOOR": _library("llvm.floor.f64"),
    "OP_CEIL": _library("llvm.ceil.f64"),
    "OP_COPYSIGN": _library("llvm.copysign.f64"),
    "OP_FMIN": _extreme("fmin", "olt"),
    "OP_FMAX": _extreme("fmax", "ogt"),
    "OP_LT": _comparison("olt"),
    "OP_LE": _comparison("ole"),
    "OP_EQ": _comparison("oeq"),
    "OP_NE": _comparison("une"),
    "OP_NOT": lambda to, a: _flag(to, to.value(f"fcmp oeq double {a}, 0.0")),
    "OP_AND": lambda to, a, b: _both(to, a, b, "and"),
    "OP_OR": lambda to, a, b: _both(to, a, b, "or"),
    "OP_IF_ELSE_ZERO": _chosen,
    "OP_SIGN": _sign,
    "OP_CONSTPOW": _library("pow"),
    **{
        f"OP_{name.upper()}": _library(name)
        for name in (
            *("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh"),
            *("exp", "log", "expm1", "log1p", "erf", "pow", "atan2", "hypot", "fmod"),
        )
    },
}

# What is done alike to some entries of arrays at a time.
ALIKE = {"OP_ASSIGN", "OP_ADD", "OP_SUB", "OP_MUL", "OP_DIV", "OP_NEG", "OP_SQ", "OP_TWICE"}


def scalar(to: Lines, name: str, *arguments: str) -> str:
    """Add an operation on doubles, and return the name of its result. Raises `Refusal`."""
    if name not in ROWS:
        raise Refusal(name)
    return ROWS[name](to, *arguments)
