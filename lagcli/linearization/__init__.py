"""The linear equations of a model about an equilibrium or a steady motion, and what they say.

In: `system.System` and a reference motion: t, q, v, lambda of all rows
Out: `linear_modes.Modes`: eigenvalues, frequencies, shapes, and a verdict on stability

`linear_modes` is the way in: it says what the eigenvalues of `spectrum`, the lowest ones of large systems (`lowest`)
and the multipliers of `floquet` mean for stability. `reference` says what kind of motion is looked at.
"""
