"""A second opinion on a run: the table and the model, without the functions that made the table.

In: `model.Model` and a table
Out: `audit_report.Audit`

`evidence` holds what is known of a table: the model's own expressions, evaluated and differentiated over its rows, and
the recorded motion, differentiated with bounds. `checks` has the laws, one family a file, and `audit_report` their
findings. `all_checks` audits a run, `rest_audit` points of rest. Nothing here knows the solver: no symbols of
`equations`, nothing of `compiled`.
"""
