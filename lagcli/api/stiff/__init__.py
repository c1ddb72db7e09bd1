"""The runs of `lagcli.limit`: the constrained one, and those with a stiff spring beside it.

In: `model.Model`, the row and the stiffnesses
Out: `ladder.StiffLimit`
"""
