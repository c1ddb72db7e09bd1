"""A Pfaffian system (D.6 as forms): differential rows that share coordinates, with the holonomic rows they meet.

Forms that share no coordinate, directly or through holonomic rows, are classified apart: their derived flags
add up.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import sympy

from lagcli.pfaffian.forms.form import Form

Coefficients = tuple[sympy.Expr, ...]


@dataclass(frozen=True, slots=True)
class PfaffianBlock:
    """C forms omega_i = sum_k rows[i][k] d(variables[k]) on the surface where every f of `surface` vanishes.

    names (C,): of the forms; variables (n,): coordinates, and time last where it occurs in any row; rows (C, n);
    surface (s,): the left sides f of the coupled holonomic rows; parameters: constants of unknown value.
    """

    names: tuple[str, ...]
    variables: tuple[sympy.Symbol, ...]
    rows: tuple[Coefficients, ...]
    parameters: tuple[sympy.Symbol, ...] = ()
    surface: tuple[sympy.Expr, ...] = ()

    def form(self, i: int) -> Form:
        """The form of row i."""
        return Form(self.names[i], self.variables, self.rows[i], self.parameters)

    def with_values(self, values: Mapping[sympy.Symbol, sympy.Expr]) -> PfaffianBlock:
        """The block for given values of all parameters."""
        rows = tuple(tuple(a.xreplace(values) for a in row) for row in self.rows)
        return PfaffianBlock(
            self.names, self.variables, rows, (), tuple(f.xreplace(values) for f in self.surface)
        )
