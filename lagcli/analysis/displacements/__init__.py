"""Allowed and virtual displacements at an instant, and the internal forces that act along lines or do not.

`bases` finds the displacements (D.6, D.8, D.9), `components` which of the relabelled components are independent
(D.16 to D.21), `internal` looks at the forces between particles, `answer` holds it all.
"""
