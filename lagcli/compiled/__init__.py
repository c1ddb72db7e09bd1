"""The system to numeric functions: the only way from symbols to numbers.

In: `system.System`
Out: `numeric.NumericSystem`: CasADi functions of t, q, v and parameters

`numeric` offers them, made of the expressions in `parts` and of the factors in `factorization`; `selection` holds the
independent rows, `row_block` rows that belong together.
"""

from lagcli.compiled.numeric import NumericSystem

__all__ = ["NumericSystem"]
