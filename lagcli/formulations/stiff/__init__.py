"""One holonomic row as a stiff spring: the system, its starts, a ladder of stiffnesses and the limit it shows."""
