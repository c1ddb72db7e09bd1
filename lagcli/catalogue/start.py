"""Codes of the equations as a whole and of their start: rows, inertia, consistency."""

from __future__ import annotations

from lagcli.catalogue.page import Page

_PENDULUM = """\
lagcli: 1
particles:
  a: {mass: 1, position: [1, 0, 0]}
holonomic:
  rod: norm(a) = 1
"""

PAGES = (
    Page(
        code="contradictory-constraints",
        stage="start",
        meaning="Rows that act along the same direction prescribe different motions.",
        why="At the start they agree, and a moment later no configuration or no velocity satisfies them all, so"
        " the model has no motion.",
        example="""\
lagcli: 1
particles:
  a: {mass: 1, position: [0, 0, 0], velocity: [1, 0, 0]}
holonomic:
  even: a.x = t
  swing: a.x = sin(t)
""",
        cure="Keep the row that is meant.",
        old="  even: a.x = t\n",
    ),
    Page(
        code="no-coordinates",
        stage="start",
        meaning="No coordinate and no velocity enters a constraint.",
        why="Such a row, `0 = 0` or `t = 1`, cannot act on the motion: its gradient vanishes, so it has no"
        " constraint force and no multiplier, and it is either empty or impossible.",
        example=_PENDULUM + "  clock: t = 1\n",
        cure="Take it out, or name the coordinate it is about.",
        old="  clock: t = 1\n",
    ),
    Page(
        code="no-inertia",
        stage="start",
        meaning="No kinetic energy depends on the rate of a generalized coordinate.",
        why="Its equation holds no acceleration, so the motion of the coordinate is not determined by"
        " d/dt(dT/dq') - dT/dq = Q.",
        example="""\
lagcli: 1
coordinates:
  theta: {value: 0.1}
  phi: {value: 0}
particles:
  a: {mass: 1, position: [sin(theta), 0, -cos(theta)]}
""",
        cure="Let a particle or the Lagrangian depend on it, or remove the coordinate.",
        old="  phi: {value: 0}\n",
    ),
    Page(
        code="indefinite-inertia",
        stage="start",
        meaning="The inertia matrix of the coordinates is not positive definite at the start.",
        why="Kinetic energy must grow with every motion. It does not where a Lagrangian has a wrong sign, or where"
        " two coordinates describe the same motion, or where coordinates are singular (spherical angles at the"
        " pole).",
        example="""\
lagcli: 1
coordinates:
  x: {value: 0}
  y: {value: 0}
lagrangian: (rate(x)**2 - rate(y)**2)/2
""",
        cure="Mend the sign, start away from the singular place, or choose other coordinates.",
        old=" - rate(y)**2",
        new=" + rate(y)**2",
    ),
    Page(
        code="dependent-constraints",
        stage="start",
        meaning="At the start some constraints follow from others: the rows B of the equations are linearly"
        " dependent.",
        why="The multiplier rule needs independent rows. With dependent ones single multipliers are not determined,"
        " and where the constraints also touch tangentially the rule itself may fail.",
        example=_PENDULUM + "  rod_again: dot(a, a) = 1\n",
        cure="Leave out the row that follows from the others; `lagcli dof` counts without it.",
        old="  rod_again: dot(a, a) = 1\n",
    ),
    Page(
        code="inconsistent-start",
        stage="start",
        meaning="The initial positions or velocities violate a constraint. (In `check` this is a warning.)",
        why="The motion starts where you put it; a start off the constraint would be off it for ever, or would have"
        " to be moved without your knowledge.",
        example=_PENDULUM.replace("[1, 0, 0]}", "[1, 0, 0.5]}"),
        cure="Mend the values, or let `--assemble` move them to the nearest consistent state.",
        old="[1, 0, 0.5]",
        new="[0.8, 0, 0.6]",
    ),
    Page(
        code="no-consistent-start",
        stage="start",
        meaning="No state near the start was found that satisfies all constraints.",
        why="The constraints contradict each other, or the start is so far away that the search does not reach"
        " them.",
        example=_PENDULUM.replace("[1, 0, 0]", "[0.6, 0, 0.8]")
        + "  far: a.x = 2\nsimulation: {assemble: true}\n",
        cure="Mend the constraints, or give initial values closer to a possible configuration.",
        old="a.x = 2",
        new="a.x = 0.6",
    ),
    Page(
        code="not-finite-at-start",
        stage="start",
        meaning="A force, an energy or a constraint has no finite value or gradient at the start.",
        why="The start lies on a pole of the model: 1/x at x = 0, the gradient of a distance between two particles"
        " at one place, log of a negative number.",
        example="""\
lagcli: 1
particles:
  a: {mass: 1, position: [0, 0, 0]}
holonomic:
  rod: distance(a, [0, 0, 0]) = 0
""",
        cure="Start elsewhere, or state the law without the pole.",
        old="distance(a, [0, 0, 0]) = 0",
        new="a = [0, 0, 0]",
    ),
    Page(
        code="reaction-includes-drive",
        stage="start",
        severity="warning",
        meaning="The reported R of a particle also holds forces that are no constraint forces.",
        why="The R of a particle x(q, t) is recovered as m a - F. Generalized forces, potentials in q and a"
        " Lagrangian act on its coordinates through carriers that the model does not state, and what they transmit"
        " to the particle is in R too.",
        example="""\
lagcli: 1
coordinates:
  theta: {value: 0.1}
particles:
  a: {mass: 1, position: [sin(theta), 0, -cos(theta)]}
forces:
  motor: {to: theta, force: 1}
""",
        cure="Declare the force on the particle where it acts on it; otherwise read R with this in mind.",
        old="to: theta, force: 1",
        new='to: a, force: "[cos(theta), 0, sin(theta)]"',
    ),
    Page(
        code="rigid-degenerate",
        stage="start",
        meaning="All particles of a rigid body start at one point.",
        why="A body takes its shape from the initial positions; a point has none, and its distances have no"
        " gradient.",
        example="""\
lagcli: 1
particles:
  a: {mass: 1, position: [1, 0, 0]}
  b: {mass: 1, position: [1, 0, 0]}
rigid:
  body: [a, b]
""",
        cure="Place the particles where they belong in the body.",
        old="b: {mass: 1, position: [1",
        new="b: {mass: 1, position: [2",
    ),
    Page(
        code="unknown-row",
        stage="start",
        meaning="`multiplier(body.9)` names a row that the body does not have.",
        why="A body of two particles has one row, one of three on a line four, one of three in a plane three, and so"
        " on: the distances of its base, then x, y, z of every further particle.",
        example="""\
lagcli: 1
particles:
  a: {mass: 1, position: [1, 0, 0]}
  b: {mass: 1, position: [2, 0, 0]}
rigid:
  body: [a, b]
outputs:
  pull: multiplier(body.9)
""",
        cure="Use a number within the body's rows; `lagcli check` lists them.",
        old="body.9",
        new="body.1",
    ),
)
