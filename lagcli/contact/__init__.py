"""One-sided rows at one instant and along one step: plain numbers, and no integrator.

In: functions of x in [0, 1] along a step; M, the rows B and G and the velocities at an instant
Out: the first crossing of zero; impulses, velocities after an impact, forces of contacts, or why there are none

`zero_search` finds where functions first cross zero and loses no root it could see, `zero_bounds` holds the bounds of
a function on a piece of the step that it works with. `complementarity` solves the problem of contacts that push or open
by the shortest vector that satisfies inequalities, and says which multipliers are unique. `impact_law` is the law of
impact and gives the forces of contacts, by formulas where there are few.
"""
