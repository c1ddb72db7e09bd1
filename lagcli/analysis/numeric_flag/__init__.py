"""The derived flag of differential rows on the surface of holonomic ones, by numbers (D.3).

At a point of f = 0 the rows over (q, t) have a kernel D. Iterated Lie brackets of fields of D show which rows can
be integrated on the surface: omega lies in the integrable part I^(oo) of the rows exactly where it vanishes on
all brackets (Frobenius; the flag is that of E. Cartan). Only values omega(bracket) in R^m are needed, and random
brackets span what all of them span. Their rank at one point is a proof that a combination does not stay; that a
value is zero is seen at a generic point in 60 digits, the surface being met to as many, and the largest value
that counted as zero is reported.

`flag_search` asks `flag_points` for a generic `evaluation_point`, `bracket_values` for random brackets there and their
growth, in many digits (`multiprecision`) where it can; `spans` tell which of them are new, and
`expression.term_sizes` how large the terms are of what counts as zero.
"""

from lagcli.analysis.numeric_flag.flag_search import NumericFlag, flag

__all__ = ["NumericFlag", "flag"]
