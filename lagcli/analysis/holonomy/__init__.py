"""Nonholonomy shown: a closed loop in the other coordinates after which one coordinate has moved.

A row that could be integrated (D.3) would keep a function of coordinates and time constant on every path that
satisfies all rows. A path that comes back in all coordinates but one, on which the row depends, cannot be. What
moves a configuration around such loops is the holonomy of the constraints.

`parts` takes the rows near the one in question, `flow` integrates paths of piecewise constant controls, `orbit`
finds the directions that paths can reach, `moves` proposes and solves for words of moves, `witness` proves.
"""
