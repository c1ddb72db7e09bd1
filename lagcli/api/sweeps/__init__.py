"""Many runs of one model: which points there are, what is kept of each run, and who computes them.

In: a model, `point_sources.SweepPoints`, `reductions.Reduction`
Out: `output.sweeps.sweep_table.PointRow`, one for each point, in their order
"""
