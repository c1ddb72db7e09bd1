"""The laws that a table is checked against, one family a file.

In: `tolerances.Evidence`
Out: a `Check` of each law: its worst entry and the limit it was compared with
"""
