"""One step after the other: tried, accepted or rejected, from the first to the one that cannot be made.

In: a scheme, a state, and the times that steps must end at
Out: the steps of a run, or the reason why there is none
"""
