"""Many runs of one model: which points there are, what is kept of each run, who computes them, and the file of rows.

In: a model, `point_sources.SweepPoints`, `reductions.Reduction`
Out: `point_task.PointRow`, one for each point, in their order
"""
