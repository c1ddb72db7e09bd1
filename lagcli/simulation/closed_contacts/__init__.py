"""One-sided constraints at one instant: which press, what an impact does, and the rows that act while some are closed.

In: gaps, their rates and rows at a state
Out: impulses, multipliers, and the contacts that stay closed
"""
