"""The start of a run: finite, with inertia, on the constraints; assembled, or refused.

In: `numeric.NumericSystem` and the values of the model
Out: a consistent state

`consistent_start` is the way in: `initial` checks the declared start, `assembly` moves it to the nearest consistent
state by `projection` (steps onto the constraints) and `configuration_search` (from several starts), `conflict` names
rows that cannot hold together, `known_starts` keeps what was found, `sample_points` finds other points of the
constraint surface.
"""
