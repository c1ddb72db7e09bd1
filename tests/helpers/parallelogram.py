"""A parallelogram with a wall: its bars are in one line where a.y = 0."""

# It turns with angular velocity 1 from a.y = 1.
LINKAGE = """lagcli: 1
particles:
  a: {mass: 1, position: [0, 1, 0], velocity: [1, 0, 0]}
  b: {mass: 1, position: [2, 1, 0], velocity: [1, 0, 0]}
holonomic:
  left: norm(a) = 1
  right: "distance(b, [2, 0, 0]) = 1"
  bar: distance(a, b) = 2
  plane: a.z = 0
  other: b.z = 0
"""
