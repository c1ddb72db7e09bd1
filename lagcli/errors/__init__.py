"""Errors and warnings of model files: located, coded, collected, and the pages that explain them.

In: spans of source text and a code
Out: `diagnostics.Diagnostic`, `diagnostics.ModelError`, pages of `lagcli explain`

`diagnostics` holds and raises them and knows words of other programs, `catalogue` explains each code and names the
equations (D.n), `requirements` refuses libraries that are too old.
"""
