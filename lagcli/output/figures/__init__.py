"""Figures of runs, loops and audits; the only package that uses matplotlib."""
