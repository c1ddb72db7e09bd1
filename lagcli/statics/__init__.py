"""Points of rest and stationary points on constraint surfaces (D.25), in plain numbers.

In: `system.System` and start values
Out: `static_report.StaticReport`: points with q, lambda and type, and what is known of their completeness

`static_laws` has the equations in symbols, `static_problem` their values, `newton` solves them from one start,
`point_search` from many, `further_zeros` goes on from what is known; `all_zeros` and `one_unknown` prove that none is
left out.
"""
