"""Statements about a model that need no integration of it.

In: `system.System` and a consistent state
Out: counts, verdicts, multiplier uniqueness, displacements

`dof` counts, `redundancy` and `uniqueness` look at multipliers, `classification` judges rows by `pfaffian` and
`numeric_flag`, `codimension` proves the codimension of the surface, `holonomy` draws the loop that shows a row to be
nonholonomic, `displacements` gives bases of allowed and virtual displacements.
"""
