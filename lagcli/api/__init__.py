"""The commands as Python functions: each calls the stages in their order.

In: `model.Model` or a path, options
Out: the result of a command

No physics and no printing here. `load` reads models, `cache` compiles them, `run_settings` and `prepare_run` begin
runs; `sweep` and what has its name, `point_task` and `reductions` are many of them.
"""
