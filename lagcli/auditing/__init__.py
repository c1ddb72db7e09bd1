"""A second opinion on a run: the table and the model, without the functions that made the table.

In: `model.Model` and a table
Out: `audit_report.Audit`

`table_input` reads the table; `autodiff` differentiates the model's own expressions over numpy arrays, all rows of the
table at once; `model_values` gives names their values; `laws` evaluates rows, forces and energies; `differences`
differentiates and integrates the recorded motion and says how well; `all_checks` makes the checks and
`audit_report` holds them. Nothing here knows the solver: no symbols of `equations`, nothing of `compiled`.
"""
