"""Differential constraints as Pfaffian forms: which can be integrated, and to what (D.3). SymPy only.

In: rows of a model as forms
Out: verdicts, derived flags, first integrals with proofs

`forms.form` states them, `translate` makes them of a model; `single_form.frobenius` judges one form,
`flag.derived_flag` finds the derived flag of several, `integrals` what they integrate to; `exact.zero_test` is behind
every proof.
"""
