"""The start of a run: finite, with inertia, on the constraints; assembled, or refused.

In: `numeric.NumericSystem` and the values of the model
Out: a consistent state

`consistent_start` is the way in, and keeps what was found: `initial` checks the declared start (`singular_inertia` says
why it has no accelerations, `gaps` on which side of one-sided constraints it lies), `assembly` moves it to the nearest
consistent state by `projection` (steps onto the constraints) and `configuration_search` (from several starts),
`conflict` names rows that cannot hold together, `projection` also finds other points of the constraint surface,
`lipschitz` warns where a motion need not be unique.
"""
