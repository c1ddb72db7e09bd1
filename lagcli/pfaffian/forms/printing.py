"""SymPy expressions as texts in the notation of the model format."""

import sympy
from sympy.printing.str import StrPrinter


class _Printer(StrPrinter):  # type: ignore[misc] # SymPy has no types
    """Prints in the notation of the model format."""

    def _print_Abs(self, expression: sympy.Expr) -> str:
        return f"abs({self._print(expression.args[0])})"

    def _print_Min(self, expression: sympy.Expr) -> str:
        return f"min({', '.join(map(self._print, expression.args))})"

    def _print_Max(self, expression: sympy.Expr) -> str:
        return f"max({', '.join(map(self._print, expression.args))})"

    def _as_ordered_terms(self, expression: sympy.Expr, order: str | None = None) -> list[sympy.Expr]:
        """As usual, but a sum does not begin with a minus sign where a term has none."""
        terms = list(super()._as_ordered_terms(expression, order=order))
        first = next((i for i, term in enumerate(terms) if not term.could_extract_minus_sign()), 0)
        return [terms[first], *terms[:first], *terms[first + 1 :]]

    def _print_Exp1(self, expression: sympy.Expr) -> str:
        return "exp(1)"


def written(expression: sympy.Expr) -> str:
    """The text of an expression in the notation of the model format."""
    return str(_Printer().doprint(expression))
