"""The start of a run: finite, with inertia, on the constraints; assembled, or refused.

In: `numeric.NumericSystem` and the values of the model
Out: a consistent state

`initial` checks the start, `assembly` moves it to the nearest consistent state by `projection` (steps onto the
constraints) and `configuration_search` (from several starts), `conflict` names rows that cannot hold together,
`sample_points` finds other points of the constraint surface.
"""
