"""The start of a run: finite, with inertia, on the constraints; assembled, or refused.

In: `numeric.NumericSystem` and the values of the model
Out: a consistent state

`consistent_start` is the way in: `initial` checks the declared start, `gaps` on which side of one-sided constraints it
lies, `assembly` moves it to the nearest consistent state by `projection` (steps onto the constraints, and along them)
and `configuration_search` (from several starts), `conflict` names rows that cannot hold together, `precise_rows` looks
at rows in many digits, `lipschitz` warns where a motion need not be unique.
"""
