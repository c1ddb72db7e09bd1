"""Codes of the equations as a whole and of their start: rows, inertia, consistency."""

from __future__ import annotations

from lagcli.errors.catalogue.page import Page

_PENDULUM = """\
lagcli: 1
particles:
  a: {mass: 1, position: [1, 0, 0]}
holonomic:
  rod: norm(a) = 1
"""

PAGES = (
    Page(
        code="branch-cut",
        stage="start",
        severity="warning",
        meaning="A row or a force has an angle from `atan2` or `atan`, which jumps by a whole turn at its cut.",
        why="`atan2(y, x)` jumps from pi to -pi where y = 0 and x < 0. Where this changes a holonomic row by a constant"
        " only, as in `b.z = h*atan2(b.y, b.x)`, the row has a smooth continuation: a run counts the turns and goes on."
        " Where the slope of a row jumps too, a run that comes to the cut stops and names the row. A force that jumps"
        " acts on the other side as the text says; a potential that jumps there changes the energy.",
        example="""\
lagcli: 1
particles:
  b: {mass: 1, position: [1, 0, 0]}
holonomic:
  circle: b.x**2 + b.y**2 = 1
  helix: b.z = 0.2*atan2(b.y, b.x)
""",
        cure="Write the law with the sine or cosine of the angle; where it is meant to go on through many turns nothing"
        " needs to be done.",
        old="circle: b.x**2 + b.y**2 = 1\n  helix: b.z = 0.2*atan2(b.y, b.x)",
        new="across: b.x = cos(5*b.z)\n  along: b.y = sin(5*b.z)",
    ),
    Page(
        code="not-lipschitz",
        stage="start",
        severity="warning",
        meaning="A force, an inertia or a row has an infinite slope, or jumps, at the start.",
        why="The equations (D.24) have exactly one solution from a start at which forces, inertia and rows are"
        " Lipschitz: their differences stay below a constant times the distance. `sqrt(abs(x))` at x = 0 is not:"
        " a particle at rest there may stay, or leave at any time, and all these motions satisfy the equations."
        " A run gives one of them.",
        example="""\
lagcli: 1
coordinates:
  x: {value: 0}
lagrangian: rate(x)**2/2
forces:
  push: {to: x, force: sqrt(abs(x))}
""",
        cure="Start beside that place, or write the force without the infinite slope.",
        old="value: 0",
        new="value: 0.01",
    ),
    Page(
        code="contradictory-constraints",
        stage="start",
        meaning="Rows that act along the same direction prescribe different places or motions.",
        why="No configuration or no velocity satisfies them all (two lengths of one rod), or they agree at the start"
        " and part a moment later, so the model has no motion. The message names the smallest set of them that was"
        " found: without any one of these rows the others can hold. Rows of which a combination says g(q, t) dt = 0 do"
        " not contradict each other as long as g can vanish: they demand g = 0, a hidden condition, which is named,"
        " counted as a holonomic constraint and asked of the start. Only where g vanishes nowhere, or at single times"
        " alone, does the combination say dt = 0, which nothing satisfies.",
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
        meaning="No coordinate and no velocity enters a constraint with a slope.",
        why="Such a row, `0 = 0`, `t = 1` or `sign(a.x) = 1`, cannot act on the motion: its gradient vanishes, so it"
        " has no constraint force and no multiplier, and it is either empty or impossible. A differential row without"
        " velocities, `(a.x - 1)*dt = 0`, is taken: it demands the hidden condition a.x = 1.",
        example=_PENDULUM + "  clock: t = 1\n",
        cure="Take it out, or name the coordinate it is about.",
        old="  clock: t = 1\n",
    ),
    Page(
        code="no-inertia",
        stage="start",
        meaning="No kinetic energy is quadratic in the rate of a generalized coordinate, or its inertia vanishes at"
        " the start.",
        why="Its equation holds no acceleration, so the motion of the coordinate is not determined by"
        " d/dt(dT/dq') - dT/dq = Q. A Lagrangian linear in the rate, such as x*rate(y), gives an equation of first"
        " order, which this program does not solve; a square of a radius that is zero at the start, or a power of"
        " a rate that is zero, has an inertia that vanishes there. A constraint on the coordinate gives it none. An"
        " inertia that vanishes later stops the run (exit 3), and the reason names the motion that lost it.",
        example="""\
lagcli: 1
coordinates:
  theta: {value: 0.1}
  phi: {value: 0}
particles:
  a: {mass: 1, position: [sin(theta), 0, -cos(theta)]}
""",
        cure="Give it a mass, remove the coordinate, or write it as a function of the others (where a constraint fixes"
        " it, insert what the constraint says). Start away from a place where its inertia vanishes.",
        old="  phi: {value: 0}\n",
    ),
    Page(
        code="indefinite-inertia",
        stage="start",
        meaning="The inertia matrix of the coordinates is not positive definite at the start.",
        why="Kinetic energy must grow with every motion; the message names one with which it does not, by its rates."
        " That happens where a Lagrangian has a wrong sign, where two coordinates describe the same motion, or"
        " where coordinates are singular (spherical angles at the pole). It is asked of all motions, those that a"
        " constraint forbids too.",
        example="""\
lagcli: 1
coordinates:
  x: {value: 0}
  y: {value: 0}
lagrangian: (rate(x)**2 - rate(y)**2)/2
""",
        cure="Correct the sign, leave out one of two coordinates that describe the same motion, start away from the"
        " singular place, or choose other coordinates.",
        old=" - rate(y)**2",
        new=" + rate(y)**2",
    ),
    Page(
        code="dependent-constraints",
        stage="start",
        meaning="Whether some constraints follow from others at the start cannot be decided.",
        why="Rows that follow from others are left out of the equations, for the motion is the same without them."
        " Rows that are almost, but not quite, dependent are neither: kept they give multipliers without a right"
        " digit, left out they could change the motion.",
        example=_PENDULUM.replace("rod: norm(a)", "wall: a.x") + "  tilted: a.x + 1e-6*a.y = 1\n",
        cure="Say what is meant: leave out a row that should follow from the others, or write one that is clear of"
        " them; or move the start a little.",
        old="a.x + 1e-6*a.y = 1",
        new="a.y = 0",
    ),
    Page(
        code="singular-start",
        stage="start",
        meaning="Rows are dependent at the start and not nearby, and the initial velocities lead along no branch.",
        why="At a singular configuration, a linkage stretched out in line or the crossing of two curves, several"
        " motions the constraints allow branch off. A body at rest there, or one whose velocities point between the"
        " branches, may take any of them, and the forces of the constraints have no finite value: the equations do"
        " not say which motion follows.",
        example="""\
lagcli: 1
particles:
  a: {mass: 1, position: [1, 0, 0]}
  b: {mass: 1, position: [2, 0, 0]}
holonomic:
  plane_a: a.z = 0
  plane_b: b.z = 0
  crank: norm(a) = 1
  coupler: distance(a, b) = 1
  rocker: distance(b, [1, 0, 0]) = 1
""",
        cure="Start a little aside, on the branch that is meant, or give velocities along it: with those of a and b"
        " [0, 1, 0] this linkage goes through as a parallelogram.",
        old="[1, 0, 0]}\n  b: {mass: 1, position: [2, 0, 0]}",
        new="[0.6, 0.8, 0]}\n  b: {mass: 1, position: [1.6, 0.8, 0]}",
    ),
    Page(
        code="inconsistent-start",
        stage="start",
        meaning="The initial positions or velocities violate a constraint. (In `check` this is a warning.)",
        why="The motion starts where you put it; a start off the constraint would be off it for ever, or would have"
        " to be moved without your knowledge.",
        example=_PENDULUM.replace("[1, 0, 0]}", "[1, 0, 0.5]}"),
        cure="Correct the values, or let `--assemble` move them to the nearest consistent state.",
        old="[1, 0, 0.5]",
        new="[0.8, 0, 0.6]",
    ),
    Page(
        code="no-consistent-start",
        stage="start",
        meaning="No state near the start was found that satisfies all constraints.",
        why="The constraints contradict each other, or the start is so far away that the search does not reach"
        " them. The message names the smallest set of rows that was found to have no common configuration, what"
        " was tried, and the least violation that remained: a search is no proof. Where `keep` is in the way it"
        " says so.",
        example=_PENDULUM.replace("[1, 0, 0]", "[0.6, 0, 0.8]")
        + "  far: a.x = 2\nsimulation: {assemble: true}\n",
        cure="Correct the constraints, or give initial values closer to a possible configuration.",
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
        code="kink-at-start",
        stage="start",
        meaning="The gradient of a constraint, or the constraint itself, jumps at the start.",
        why="`abs`, `sign`, `min` and `max` switch there from one branch to another, so that the constraint surface"
        " has an edge, and on an edge the constraint force has no direction. A motion over it is an impact, which"
        " the equations do not describe.",
        example="""\
lagcli: 1
particles:
  a: {mass: 1, position: [0, 0, 0]}
holonomic:
  roof: a.z = -abs(a.x)
""",
        cure="Start clear of the edge, or state the branch that is meant as an equation without the switch.",
        old="[0, 0, 0]",
        new="[1, 0, -1]",
    ),
    Page(
        code="multiplier-rule-fails",
        stage="start",
        meaning="Constraints take more freedoms than their gradients span, wherever they hold.",
        why="R = sum of lambda_i B_i lies in the span of the gradients. Three particles on a line with all three"
        " distances cannot bend, and yet no force along the line keeps the middle one from going aside: no finite"
        " multipliers give the true motion, and what would be computed without this error is a different motion.",
        example="""\
lagcli: 1
particles:
  a: {mass: 1, position: [0, 0, 0]}
  b: {mass: 1, position: [1, 0, 0]}
  c: {mass: 1, position: [2, 0, 0]}
holonomic:
  ab: distance(a, b) = 1
  bc: distance(b, c) = 1
  ac: distance(a, c) = 2
""",
        cure="Declare the particles under `rigid`: the rows of a body are independent.",
        old="holonomic:\n  ab: distance(a, b) = 1\n  bc: distance(b, c) = 1\n  ac: distance(a, c) = 2\n",
        new="rigid:\n  abc: [a, b, c]\n",
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
