"""Files that leave the program: tables, checkpoints, figures; and the trajectory they are made of.

In: rows of numbers with names
Out: files, or a refusal before the run

`runs` writes runs as they come, `trajectory` is the result of one, `tables` writes and reads tables, `figures` draws,
`atomic_file` puts a file in place as a whole, `interrupts` holds signals back meanwhile, `table_columns` says what can
be read off the rows.
"""
