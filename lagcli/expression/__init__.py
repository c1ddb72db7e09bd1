"""Text of a formula to a small tree of our own, evaluated over any algebra.

In: text
Out: `tree.Node`, and its value in an algebra given by the caller

`tokens` and `parser` read, `tree` holds the nodes, `evaluate` walks them with numbers, CasADi or SymPy symbols,
`facts` finds what is wrong with a formula before anything is computed, `integers` gives the exact values of bounds,
indices and filters of families, `intervals` the range of values.
No text is ever handed to Python or SymPy to be executed or parsed.
"""
