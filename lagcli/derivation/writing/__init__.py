"""Formulas as they are written: one tree, three dialects.

In: `formula` trees
Out: text, LaTeX, MathML
"""
