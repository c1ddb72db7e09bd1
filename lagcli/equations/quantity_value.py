"""The value of an expression that stands in no file, over the symbols of a system."""

from __future__ import annotations

import casadi as ca

from lagcli.equations.environment import Environment
from lagcli.equations.symbols import FixedExponents
from lagcli.equations.system import System
from lagcli.model import model as nouns


def value(system: System, expression: nouns.Expression) -> ca.SX:
    """A scalar of t, q, v and p; exponents of parameters are built in."""
    model = system.model
    environment = Environment(model, system.symbols, FixedExponents(model))
    return environment.scalar(expression)
