"""Runs on their way out: into the tables, figures and checkpoints that were asked for, or into memory.

In: a run that is prepared, the files it goes into
Out: files that are whole or marked as partial, `trajectory.Trajectory`, the account of the run
"""
