"""The commands as Python functions: each calls the stages in their order.

In: `model.Model` or a path, options
Out: the result of a command

No physics and no printing here. What several commands need stands in rooms, each of which imports only from those
before it:

- `models`: reads and compiles; compiled systems stay for another run, which changes no answer
- `runs`: starts and resumes runs, each a `SimulationRun` of `running`
- `sweeps`: many runs
"""
