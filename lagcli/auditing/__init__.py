"""A second opinion on a run: the table and the model, without the functions that made the table.

In: `model.Model` and a table
Out: `audit_report.Audit`

`evidence` holds what is known of a table: `table_input` reads it, `autodiff` differentiates the model's own
expressions over numpy arrays, all rows at once, `laws` evaluates rows, forces and energies, `differences`
differentiates and integrates the recorded motion and says how well. `checks` has the laws, one family a file, and
`audit_report` holds their findings and says them. `all_checks` has the registry of the checks and makes the audit of a
run, one with incidents by its parts; `rest_audit` audits points of rest. Nothing here knows the solver: no symbols of
`equations`, nothing of `compiled`.
"""
