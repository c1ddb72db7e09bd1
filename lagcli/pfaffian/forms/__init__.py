"""Pfaffian forms, blocks of them, and how their expressions are written."""
