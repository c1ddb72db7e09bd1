"""The commands as Python functions, one a file: each calls the stages in their order.

In: `model.Model` or a path, options
Out: the result of a command

No physics and no printing here. `cache` keeps compiled systems, which changes no answer; `prepare_run` starts and
resumes runs, each a `simulation_run.SimulationRun`.
"""
