"""First integrals of completely integrable systems: guesses and reductions, each verified."""
