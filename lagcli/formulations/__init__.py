"""One model in several formulations, run side by side.

In: `system.System`
Out: `comparison.Comparison`: the digits to which tables agree

`dense_functions` evaluates a system without its multipliers, `maggi` writes it in independent quantities,
`reduced_steps` integrates it there, `reduced_run` makes a table of that, `comparison` compares tables. `vakonomic` has
the equations of the other principle, `stiff` a row as a spring.
"""
