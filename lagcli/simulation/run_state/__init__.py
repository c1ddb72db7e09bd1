"""The state of a run between two steps, and what it tells: figures, incidents, why it ended; kept as a checkpoint.

In: what a run changes while it goes on
Out: `RunState` and its form as JSON, to go on from bit for bit
"""
