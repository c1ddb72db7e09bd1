"""Points of rest and stationary points on constraint surfaces (D.25), in plain numbers.

In: `system.System` and start values
Out: `stationary_point.StationaryPoint`: q, lambda, type, and what is known of their completeness

`static_laws` has the equations in symbols, `static_problem` their values, `newton` solves them from one start.
"""
