"""Figures of runs, loops and audits; the only door to matplotlib."""
