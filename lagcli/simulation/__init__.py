"""Time integration: a start to the rows of the table, one scheme a file.

In: `numeric.NumericSystem` and a consistent state
Out: rows of the table, a `RunState` to go on from, statistics

`run_entry` is the way in: it begins or resumes a run and gives it in blocks of rows, with frozen reports. `loop` takes
the steps, `row_writer` writes the rows, and `reference_run` repeats a run beside it for the digits that are right. They
use the rooms, each of which imports only from those before it:

- `scheme`: one step of a method, its length, its projection and the integrals it holds
- `run_state`: what a run is between two steps, what it tells, and checkpoints of it
- `singularity`: singular configurations, predicted and passed
- `closed_contacts`: one-sided constraints at one instant
- `stepping`: one step after the other, and why there is no next one
- `events`: instants within a step that it does not lead over
"""
