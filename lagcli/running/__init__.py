"""One run from its plan to its end: it is integrated, watched, written as it comes, and accounted for.

In: a system, a consistent start and settings; the files that the run goes into
Out: `trajectory.Trajectory`, or files that are whole or marked as partial; the account of the run

`simulation_run` is the run, `written_run` and `trajectory` carry it out, `run_account` is what it says in the end.
"""
