"""Time integration: a start to the rows of the table, one scheme a file.

In: `numeric.NumericSystem` and a consistent state
Out: rows of the table, a `RunState` to go on from, statistics

`loop` takes the steps, `method` says what a scheme is and which there are, `dop853` is one, with its coefficients in
`dop853_tableau`; `step_end` projects and judges the step of any, `line_functions` are its rows, `grid` gives their
times, `singularity_monitor` and `singularity_step` pass singular configurations, `invariants` enforces first integrals,
`timetable` ends steps where functions of t switch, `checkpoint` keeps a run, `global_error` estimates its error.
"""
