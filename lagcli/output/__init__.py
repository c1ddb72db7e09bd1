"""Files that leave the program: tables, checkpoints, figures; and the trajectory they are made of.

In: rows of numbers with names
Out: files, or a refusal before the run

`trajectory` is the result of a run, `tables` writes and reads tables, `figures` draws, `atomic_file` puts a file in
place as a whole, `table_columns` says what can be read off the rows.
"""
