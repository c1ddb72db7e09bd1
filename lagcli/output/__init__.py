"""Files that leave the program: tables, figures, charts, animations.

In: rows of numbers with names
Out: files, or a refusal before the work for them

`tables` writes and reads tables, `figures` draws figures and charts, `animation` motions, `sweeps` keeps the rows of
many runs safe, `files` puts a file in place as a whole and holds signals back meanwhile.
"""
