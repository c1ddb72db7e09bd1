"""Statements about a model that need no integration of it.

In: `system.System` and a consistent state
Out: counts, verdicts, multiplier uniqueness, displacements

`dof` counts, `redundancy` chooses the rows that a run is stepped with and tells which multipliers are unique,
`classification` judges rows by `pfaffian` and `numeric_flag`, `codimension` proves the codimension of the surface,
`holonomy` draws the loop that shows a row to be nonholonomic, `displacement_set` gives bases of allowed and virtual
displacements with the `internal_forces`, `check_report` is what `check` says.
"""
