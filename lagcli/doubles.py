"""The digits of doubles: what rounding leaves of a sum, a value, a zero, a root and a difference, each as a part.

What tells a number from rounding is taken from here. Rows at a state are known to fewer digits, and have a gap of their
own (`linear/rank.py`). Of other gaps the lower limit is `VALUE` and the upper one is `ROOT`; where one limit has to do
it is `ZERO`, the middle of them.

The tests are of `tests/unit/test_numbers_of_rows.py`, `tests/unit/test_precise_rows.py` and
`tests/unit/test_drawing_thresholds.py`.
"""

from __future__ import annotations

import math
import sys

EPS = sys.float_info.epsilon
"""The rounding of one operation, 2.2e-16."""

SUM = 2**6 * EPS
"""Of a sum or a product of some terms, as a part of the largest: 64 roundings, 1.4e-14.
`test_rows_within_the_rounding_of_their_coefficients_are_dependent` fails at 1e-15 and 1e-13."""

VALUE = 2**12 * EPS
"""Of a value that a formula, or a solution in many steps, has, as a part of its terms: 4096 roundings, 9.1e-13.
`test_singular_values_of_rounding_are_not_solved_for` fails at 1e-13 and 1e-11."""

ROOT = math.sqrt(VALUE)
"""Where a square vanishes with a value the value vanishes so roughly: points that are closer are the same one, and
entries that are this part of the largest take no part. 9.5e-7.
`test_a_row_takes_part_in_a_dependence_with_six_digits` fails at 1e-7 and 1e-5."""

ZERO = math.sqrt(VALUE * ROOT)
"""As far from the rounding of values as from what is meant: what is this part of its like is zero. 9.3e-10; numbers
that were written with ten digits are met so. `test_the_gram_matrix_tells_rows_that_are_clearly_independent` fails at
1e-11 and 1e-7."""

TINY = 1e-300
"""Added to what is divided by, so that zero over zero is zero: it changes no square of a number down to 1e-142.
`test_the_multiplier_carries_the_factor` of `tests/physics/test_row_factors.py` fails at 1e-290."""

LOST = sys.float_info.min / EPS
"""What is less, 1e-292, has lost its digits, or a rounding of it has. `test_a_result_below_the_doubles_is_lost` of
`tests/unit/test_numbers_of_statics.py` fails at 1e-293 and 1e-291."""

WHOLE = 2**53
"""Whole numbers up to this are exact."""

STEP = math.cbrt(EPS)
"""The step of a difference quotient on two sides, as a part of what changes: what it leaves out is its square, as much
as rounding over it leaves. 6.1e-6.
`test_gradients_lose_as_little_to_rounding_as_to_bends` fails at 1e-7 and 1e-4."""
