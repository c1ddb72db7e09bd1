"""Constraint rows at one configuration: the metric of the mass matrix, rank, independent rows.

In: M and B at a point
Out: lengths, projections, a rank or its doubt, independent rows and what the others follow from

`metric` measures with M, `rank` finds a rank by the gap in the singular values, and `independent_rows` chooses rows and
tells which others follow from them. `surface` is the one road onto f = 0. `decompositions` are those of matrices known
to rounding; `generic_direction` there belongs to no model.
"""
