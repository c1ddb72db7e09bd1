"""Time integration: a start to the rows of the table, one scheme a file.

In: `numeric.NumericSystem` and a consistent state
Out: rows of the table, a `RunState` to go on from, statistics

`loop` takes the steps, `dop853` is the scheme with its coefficients in `dop853_tableau`, `grid` gives the times of the
rows, `singularity_monitor` and `singularity_step` pass singular configurations, `invariants` enforces first integrals,
`timetable` ends steps where functions of t switch, `checkpoint` keeps a run, `global_error` estimates its error.
"""
