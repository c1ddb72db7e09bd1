"""System -> numeric functions: the only staircase from symbols to numbers.

`numeric` offers them, made of the expressions in `parts`: `expanded` where the factorization is small enough
to be written out, `factored` where it is not, `table` for the rows.
"""

from lagcli.compile.numeric import NumericSystem

__all__ = ["NumericSystem"]
