"""Time integration: a start to the rows of the table, one scheme a file.

In: `numeric.NumericSystem` and a consistent state
Out: rows of the table, a `RunState` to go on from, statistics

`loop` starts, resumes and hands out rows; `stepper` takes the steps, their lengths from `controller`; `row_writer`
writes the rows; an `event` is what ordinary steps do not lead over, `singular_event` the passing of a singular
configuration with `singularity_monitor` and `singularity_step`; `stop_diagnosis` words why a run stopped.
`method` says what a scheme is and which there are, `dop853` is one, with its coefficients in `dop853_tableau`;
`step_end` projects and judges the step of any, `line_functions` are its rows. `grid` gives the times of the rows,
`invariants` enforces first integrals, `timetable` ends steps where functions of t switch, `checkpoint` keeps a run,
`global_error` estimates its error.
"""
