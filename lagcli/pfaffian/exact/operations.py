"""The work of computer algebra in operations: a budget of them ends at the same place on every machine.

An operation is the making of a sum, product, power, function or whole number: SymPy remembers their values, and its
memory counts how often it is asked. Searches for integrals make 20 000 to 70 000 in a second of a processor of 2023,
some 40 000 in the middle. Arithmetic of polynomials and of intervals makes few.
"""

import sympy
from sympy.core.function import Application
from sympy.core.operations import AssocOp

SLOWEST = 8_000.0
"""Operations in a second of processor time, below which a budget of them ends by time: there the work was hardly
anything but arithmetic that is not counted. On a machine some times as slow others still end by their operations."""

_COUNTED = tuple(
    make.cache_info  # not there where SymPy remembers nothing (`SYMPY_USE_CACHE=no`)
    for make in (AssocOp.__new__, sympy.Pow.__new__, Application.__new__, sympy.Integer.__new__)
    if hasattr(make, "cache_info")
)


def done() -> int:
    """The operations of this process so far."""
    told = [info() for info in _COUNTED]
    return sum(one.hits + one.misses for one in told)
