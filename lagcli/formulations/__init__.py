"""One model in several formulations, run side by side.

In: `system.System`
Out: `comparison.Comparison`: the digits to which tables agree

`maggi` writes a system in independent quantities, without its multipliers, and integrates it there; `comparison`
compares tables. `vakonomic_system` has the equations of the other principle; `stiff_system` has a row as a spring,
`stiff_ladder` what runs of several stiffnesses show.
"""
