"""The commands as Python functions: each calls the stages in their order.

In: `model.Model` or a path, options
Out: the result of a command

No physics and no printing here. `load` reads models, `cache` compiles them and keeps compiled systems for another run,
`run_settings` has the settings of runs, `prepare_run` begins one; `sweep` and what has its name, `point_task` and
`reductions` are many runs.
"""
