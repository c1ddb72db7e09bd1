"""The rows of many runs on their way into a file: the table, the journal that keeps them safe, shards and the account.

In: `sweep_table.PlannedRows`, rows as they are computed, the files they go into
Out: a table that is whole, or a journal to go on from; `written_sweep.SweepEnding`
"""
