"""Differential constraints as Pfaffian forms: which can be integrated, and to what (D.3). SymPy only.

`form.Form` states a constraint, `alone.classify` judges it by itself, `zero` is the zero test behind every
proof.
"""
