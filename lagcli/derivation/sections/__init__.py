"""The sections of a derivation, each with its numbers (D.n).

In: the symbolic system
Out: the lines of a page
"""
