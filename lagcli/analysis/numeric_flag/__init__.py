"""The derived flag of differential rows on the surface of holonomic ones, by numbers (D.3).

At a point of f = 0 the rows over (q, t) have a kernel D, and omega lies in their integrable part I^(oo) exactly where
it vanishes on all Lie brackets of fields of D (Frobenius, E. Cartan). Random brackets span what all of them span. Their
rank at one point is a proof that a combination does not stay; that a value is zero is seen at a generic point in 60
digits, and the largest value that counted as zero is reported.

`flag_search` asks `flag_points` for a generic `evaluation_point`, and `bracket_values` for random brackets there;
`spans` tell which of them are new.
"""

from lagcli.analysis.numeric_flag.flag_search import NumericFlag, flag

__all__ = ["NumericFlag", "flag"]
