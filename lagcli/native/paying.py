"""When native code pays: the library that makes it takes long to load, and each level of it long to make."""

from __future__ import annotations

import sys

LIBRARY = "llvmlite"


class PayingParameters:
    """Steps by the same functions; a step of a small model by the interpreter takes some 25 us. The tests are of
    `tests/unit/test_numbers_of_native_code.py`."""

    __slots__ = ()

    loaded: int = 20
    """Where the library is loaded, code that is kept is looked for after so many: that takes 5 ms.
    `test_native_code_is_looked_for_where_its_library_is_loaded`."""
    soon: int = 2000
    """Else after so many, and code is made: to load the library takes 50 ms, and to make the code as long.
    `test_native_code_pays_after_two_thousand_steps`."""
    best: int = 200_000
    """After so many the best code is made, which takes two to six times as long and is up to 1.6 times as fast.
    `test_the_best_code_pays_after_two_hundred_thousand_steps`."""
    at_once: float = 5e8
    """A loop returns after so many bytes of functions times steps, some hundredths of a second: for interrupts.
    `test_a_loop_returns_within_some_hundredths_of_a_second`."""


PARAMETERS = PayingParameters()


def pays(steps: int) -> bool:
    """True if native code may pay after so many steps by the same functions."""
    return steps >= (PARAMETERS.loaded if LIBRARY in sys.modules else PARAMETERS.soon)


def steps_at_once(size: int) -> int:
    """The steps that a loop may take before it returns, by functions of so many bytes."""
    return max(1, int(PARAMETERS.at_once / size))
