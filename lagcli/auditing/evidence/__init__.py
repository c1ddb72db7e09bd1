"""The evidence for the checks: the table, the model's own numbers at its rows, and how well each is known.

In: a model, the columns and rows of a table, its incidents
Out: `tolerances.Evidence`, by expressions over arrays and their own derivatives, without the functions of the solver
"""
