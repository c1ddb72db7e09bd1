"""Files that commands write: tables of runs as they come, their figures, new model files.

In: a plan of a table, blocks of rows
Out: files that are whole, or marked as partial
"""
