"""Points of rest and stationary points on constraint surfaces (D.25), in plain numbers.

In: `system.System` and start values
Out: `static_report.StaticReport`: points with q, lambda and type, and what is known of their completeness

`static_problem` has the equations, `refine` solves them from one start and goes on from what is known, `point_search`
from many; `point_type` and `flat_directions` judge a point, `continuum` says whether it is alone; `all_zeros` proves
that none is left out, `kink_points` looks where no lambda need be.
"""
