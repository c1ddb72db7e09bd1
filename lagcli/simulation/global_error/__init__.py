"""The number of digits of a run that are right: a global error estimate from the same run at a tighter tolerance."""
