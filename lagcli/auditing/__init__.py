"""A second opinion on a run: the table and the model, without the functions that made the table.

`record` reads the table; `tape` differentiates the model's own expressions over numpy arrays, all rows of the table
at once; `scene` gives names their values; `laws` evaluates rows, forces and energies; `differences` differentiates
and integrates the recorded motion and says how well; `examine` makes the checks and `report` holds them.
Nothing here knows the solver: no symbols of `mechanics`, nothing of `compile`.
"""
