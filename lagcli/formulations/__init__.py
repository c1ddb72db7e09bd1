"""One model in several formulations, run side by side.

In: `system.System`
Out: `comparison.Comparison`: the digits to which tables agree

`dense_functions` evaluates a system without its multipliers, `maggi` writes it in independent quantities,
`reduced_run` integrates it there, `comparison` compares tables. `vakonomic_system` has the equations of the other
principle, `action_forces` the forces it can hold, `principles` what comes of both; `stiff_system` has a row as a
spring, `stiff_start` its starts, `stiff_ladder` what runs of several stiffnesses show.
"""
