"""The contents of a file: particles, coordinates, forces, constraints, settings; no dynamics yet.

In: checked values and expression trees
Out: `model.Model`

`model` holds the nouns, `family` entries that stand for many members, `settings` those of a run.
"""
