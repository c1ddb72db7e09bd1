"""Differential constraints as Pfaffian forms: which can be integrated, and to what (D.3). SymPy only.

In: rows of a model as forms
Out: verdicts, derived flags, first integrals with proofs

`forms.form` states them, `translate` makes them of a model; `frobenius` judges one form, `derived_flag` finds the
flag of several, `first_integrals` what they integrate to; `exact.zero_test` is behind every proof.
"""
