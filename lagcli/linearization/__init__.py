"""The linear equations of a model about an equilibrium or a steady motion, and what they say.

In: `system.System` and a reference motion: t, q, v, lambda of all rows
Out: `linear_modes.Modes`: eigenvalues, frequencies, shapes, and a verdict on stability

`linearized` differentiates the equations at the reference, `reference` says what kind of motion it is, `freedoms`
takes the rows out with a basis of what they leave free, `spectrum` finds the eigenvalues, `lowest` the lowest of large
systems, `floquet` the period of a motion and its multipliers, `stability` what all this says of stability;
`assembled_modes` puts them together.
"""
