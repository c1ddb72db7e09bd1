"""How many digits of a run are right: a global error estimate from the same run at a tighter tolerance."""
