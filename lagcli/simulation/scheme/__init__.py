"""A scheme: one step of a method, its dense output, the projection at its end, and the integrals it holds.

In: `numeric.NumericSystem` and the state at the beginning of a step
Out: the state at its end on f = 0 and B v + b = 0, its error, and the curve between the two

`method` says what a scheme is and which there are, and gives rows of the table; `dop853` is one, with its coefficients
in `compiled.dop853_tableau`. `step_end` projects and judges the step of any, `controller` gives its length.
`invariants` holds first integrals; `collocation` is the step across singular configurations.
"""
