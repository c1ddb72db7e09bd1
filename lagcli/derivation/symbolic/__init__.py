"""The equations of motion of a model in SymPy.

In: a model
Out: rows, forces, energies, multipliers in closed form where they are short, and the linear equations
"""
