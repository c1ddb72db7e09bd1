"""The linear equations of a model about an equilibrium or a steady motion, and what they say.

In: `system.System` and a reference motion: t, q, v, lambda of all rows
Out: `linear_modes.Modes`: eigenvalues, frequencies, shapes, and a verdict on stability

`linearized` differentiates the equations at the reference, `reference` says what kind of motion it is, `spectrum` finds
the eigenvalues in what the rows leave free, `lowest` the lowest of large systems, `floquet` the period of a motion and
its multipliers; `linear_modes` puts them together and says what they mean for stability.
"""
