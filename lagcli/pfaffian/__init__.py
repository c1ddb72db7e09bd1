"""Differential constraints as Pfaffian forms: which can be integrated, and to what (D.3). SymPy only.

`form` and `block` state them, `translate` makes them of a model; `alone.frobenius` judges one form,
`together.flag` finds the derived flag of several, `integrals` what they integrate to; `exact.zero` is the zero test
behind every proof.
"""
