"""The loop of a run: from its start, step by step, to the rows of the table."""
