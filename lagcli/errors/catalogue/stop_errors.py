"""Codes of runs that stop before their end: exit 3, and the object `stopped` of `--stats`."""

from __future__ import annotations

from lagcli.errors.catalogue.page import Page

PAGES = (
    Page(
        code="singular-constraints",
        stage="run",
        severity="stop",
        meaning="The run came to a singular configuration through which it cannot go on smoothly.",
        why="Where rows become dependent, their forces grow without bound or may be shared in many ways, and several"
        " motions may branch off. lagcli passes such an instant where one smooth motion leads through it, and stops"
        " where there is none: a linkage at its dead point, or a curve with a cusp.",
        example="""\
lagcli: 1
particles:
  a: {mass: 1, position: [1, 1, 0], velocity: [-2, -3, 0]}
holonomic:
  cusp: a.y**2 = a.x**3
  plane: a.z = 0
simulation: {duration: 1, samples: 11}
""",
        cure="End the run before that time, or write rows that are regular there.",
        old="duration: 1,",
        new="duration: 0.3,",
    ),
    Page(
        code="no-solution-beyond",
        stage="run",
        severity="stop",
        meaning="The constraints have no common solution after this time, or none without an impact.",
        why="The rows hold up to here, and no configuration near satisfies them all a moment later: their surface ends,"
        " they begin to contradict each other, or they make velocities jump. A hidden condition, which rows demand"
        " because a combination of them says g(q, t) dt = 0, has no multiplier: where the forces lead off it there is"
        " no motion, and the reason names it.",
        example="""\
lagcli: 1
particles:
  a: {mass: 1, position: [0, 0, 0], velocity: [1, 0, 0]}
holonomic:
  floor: a.y = 0
  ramp: a.y = max(0, a.x - 0.5)**3
  plane: a.z = 0
simulation: {duration: 1, samples: 11}
""",
        cure="End the run before that time, or take out the row that cannot hold any longer.",
        old="  floor: a.y = 0\n",
        new="",
    ),
    Page(
        code="not-finite",
        stage="run",
        severity="stop",
        meaning="The accelerations, multipliers or a column of the table are not finite beyond this time.",
        why="A function of the model ends or has a pole there, as log(x) and 1/x have at 0, or the constraints become"
        " dependent.",
        example="""\
lagcli: 1
coordinates:
  x: {value: 1, rate: -1}
lagrangian: rate(x)**2/2
forces:
  push: {to: x, force: sqrt(x)/100}
simulation: {duration: 2, samples: 11}
""",
        cure="Give the function a value wherever the motion leads, or end the run before.",
        old="sqrt(x)/100",
        new="sqrt(abs(x))/100",
    ),
    Page(
        code="step-too-small",
        stage="run",
        severity="stop",
        meaning="The run would need steps too small to go on.",
        why="The step needed for the tolerance has shrunk below the rounding of the time, as at a collision where"
        " forces grow without bound, or where masses that differ by a factor of 1e10 amplify rounding; or so many"
        " steps would be needed that the run would take days, as with forces far too stiff for an explicit method.",
        example="""\
lagcli: 1
coordinates:
  x: {value: 1}
lagrangian: rate(x)**2/2 + 1/x
simulation: {duration: 2, samples: 11}
""",
        cure="End the run before that time, smooth the force, or replace the stiffest springs by constraints.",
        old="duration: 2",
        new="duration: 1",
    ),
    Page(
        code="interrupted",
        stage="input",
        severity="stop",
        meaning="A signal ended the run: Ctrl-C, or SIGTERM or SIGHUP of the system.",
        why="The exit code is 128 and the number of the signal: 130 after Ctrl-C, 143 after SIGTERM. The complete rows"
        " are in FILE.partial, and FILE is as it was.",
        example="lagcli simulate model.yaml -o run.csv --stats run.json    # and then Ctrl-C",
        cure="Run again; with a checkpoint the run can go on where it ended.",
        new="lagcli simulate model.yaml -o run.csv --checkpoint ck.json --resume ck.json    # --checkpoint before, too",
    ),
)
