"""Errors and warnings of model files: located, coded, collected, and the pages that explain them.

In: spans of source text and a code
Out: `diagnostics.Diagnostic`, `diagnostics.ModelError`, pages of `lagcli explain`

`diagnostics` holds and raises them, `catalogue` explains each code, `equation_list` names the equations (D.n),
`meant` knows words of other programs, `requirements` refuses libraries that are too old.
"""
