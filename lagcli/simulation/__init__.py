"""Time integration: a start to the rows of the table, one scheme a file.

In: `numeric.NumericSystem` and a consistent state
Out: rows of the table, a `RunState` to go on from, statistics

`run_entry` is the way in: it begins or resumes a run and gives a `run_in_blocks`, whose blocks of rows and frozen
reports are the way out. Each room below imports only from those before it:

- `scheme`: one step of a method, its length, its projection and the integrals it holds
- `run_state`: what a run is between two steps, what it tells, and checkpoints of it
- `singularity`: singular configurations, predicted and passed
- `closed_contacts`: one-sided constraints at one instant
- `stepping`: one step after the other, and why there is no next one
- `events`: instants within a step that it does not lead over
- `run`: `loop` takes the steps from a `run_start`, `row_writer` writes the rows
- `global_error`: the digits of a run that are right
"""
