"""Text of a formula -> a small tree of our own, and its evaluation over any algebra.

`tokens` and `parser` read, `tree` holds the nodes, `evaluate` walks them with numbers, CasADi or SymPy
symbols, `facts` finds what is wrong with a formula before anything is computed, `whole` gives the exact values
of bounds, indices and filters of families.
No text is ever handed to Python or SymPy to be executed or parsed.
"""
