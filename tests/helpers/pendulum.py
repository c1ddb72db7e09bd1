"""The pendulum of many tests as the text of a model; each adds its line `simulation:`."""

# It starts at the height of the pivot, on its way down.
PENDULUM = """\
lagcli: 1
title: A pendulum
parameters: {m: 1, L: 1, g: 9.81}
particles:
  a: {mass: m, position: [L, 0, 0], velocity: [0, 0, -1]}
forces:
  weight: {to: all, force: [0, 0, -m*g]}
holonomic:
  rod: L = norm(a)
  plane: a.y = 0
"""
# It hangs at rest.
HANGING = PENDULUM.replace("position: [L, 0, 0], velocity: [0, 0, -1]", "position: [0, 0, -L]")
