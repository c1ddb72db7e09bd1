"""Codes of expressions: how they are written, and what they may depend on."""

from __future__ import annotations

from lagcli.errors.catalogue.page import Page

_BALL = """\
lagcli: 1
particles:
  a: {mass: 1, position: [1, 0, 0]}
"""

_KNIFE = """\
lagcli: 1
coordinates:
  x: {value: 0, rate: 1}
  y: {value: 0}
  theta: {value: 0}
lagrangian: (rate(x)**2 + rate(y)**2 + rate(theta)**2)/2
differential:
"""

PAGES = (
    Page(
        code="syntax",
        meaning="An expression breaks the rules of writing: something is missing, superfluous or never closed.",
        why="Expressions are ordinary mathematics with every operator written: `2*x`, not `2x`. An equation has"
        " one `=`, all other expressions have none.",
        example=_BALL + "holonomic:\n  line: 2a.x = 1\n",
        cure="Write the operator.",
        old="2a.x = 1",
        new="2*a.x = 2",
    ),
    Page(
        code="unexpected-character",
        meaning="A character has no meaning in an expression.",
        why="A power is `**`; typographic signs (a Unicode minus, a middle dot, a superscript) are not operators,"
        " and quotes and braces have no use inside an expression.",
        example=_BALL + "holonomic:\n  circle: a.x^2 + a.y^2 = 1\n",
        cure="Write `**` for a power.",
        old="a.x^2 + a.y^2",
        new="a.x**2 + a.y**2",
    ),
    Page(
        code="expression-too-long",
        stage="input",
        meaning="One expression is longer than 1 048 576 characters.",
        why="The cost of reading is bounded, so that a wrong or hostile file cannot stop the program.",
        example="lagcli check generated.yaml    # with a potential of two million characters",
        cure="Split it: several potentials add up, and parts can be named under `definitions`.",
    ),
    Page(
        code="wrong-arguments",
        meaning="A function is called with too many or too few arguments, or with one of the wrong kind.",
        why="`atan2(y, x)` and `distance(u, w)` take two arguments, `sqrt(x)` one; `reaction(...)` takes the name of"
        " a particle, and the multipliers of a rigid body or of a vector equation are named one by one.",
        example=_BALL + "outputs:\n  angle: atan2(a.z)\n",
        cure="Give the arguments the function takes.",
        old="atan2(a.z)",
        new="atan2(a.z, a.x)",
    ),
    Page(
        code="bad-rate",
        meaning="`rate(...)` holds something else than the name of a generalized coordinate.",
        why="`rate(theta)` is the rate of a coordinate. The velocity of a particle is `a.vx` or `a.v`; the"
        " differential of any expression is `d(...)`, in differential constraints. A rate"
        " of a rate is an acceleration: accelerations are results, m a = F + R, and can be used under `outputs` only.",
        example=_KNIFE + "  edge: rate(x*y) = 0\n",
        cure="Write the rates of the coordinates, or differentials.",
        old="rate(x*y)",
        new="d(x*y)",
    ),
    Page(
        code="not-a-scalar",
        meaning="A vector is written where a number is needed.",
        why="Masses, potentials and arguments of `sin`, `sqrt` or `**` are scalars.",
        example=_BALL + "outputs:\n  square: a**2\n",
        cure="Take a component, or `dot(u, w)`, `norm(u)`, `distance(u, w)`.",
        old="a**2",
        new="dot(a, a)",
    ),
    Page(
        code="not-a-vector",
        meaning="A scalar is written where a vector is needed.",
        why="Positions, velocities, forces on particles and the arguments of `dot`, `cross`, `norm` and `distance`"
        " are vectors with three components.",
        example=_BALL + "forces:\n  weight: {to: a, force: -9.81}\n",
        cure="Write the vector.",
        old="-9.81",
        new="[0, 0, -9.81]",
    ),
    Page(
        code="vector-length",
        meaning="A vector has more or fewer than three components.",
        why="Space has three dimensions here. A plane problem keeps its third component, held by a constraint such"
        " as `a.y = 0` where it would move.",
        example="""\
lagcli: 1
particles:
  a: {mass: 1, position: [1, 0]}
""",
        cure="Write three components.",
        old="[1, 0]",
        new="[1, 0, 0]",
    ),
    Page(
        code="vector-mismatch",
        meaning="Vectors and scalars are combined in a way that has no meaning, or more than one.",
        why="Vectors are added to vectors, and multiplied or divided by scalars. A product of two vectors is"
        " `dot(u, w)` or `cross(u, w)`.",
        example=_BALL + "outputs:\n  power: a.v*a.v\n",
        cure="Name the product that is meant.",
        old="a.v*a.v",
        new="dot(a.v, a.v)",
    ),
    Page(
        code="not-finite",
        meaning="A constant part of an expression is infinite or not defined.",
        why="A division by zero, a root of a negative number or `9**9**9` would make every number after it"
        " meaningless.",
        example="""\
lagcli: 1
parameters: {L: 1, R: 2, side: sqrt(L**2 - R**2)}
particles:
  a: {mass: 1, position: [side, 0, 0]}
""",
        cure="Correct the values or the formula.",
        old="L: 1",
        new="L: 3",
    ),
    Page(
        code="position-not-allowed",
        meaning="An expression that must be constant depends on positions or coordinates, or the position of a"
        " particle depends on Cartesian particles.",
        why="Parameters, masses and initial values are numbers. A position may depend on generalized coordinates"
        " and time only; a relation to a Cartesian particle is a constraint.",
        example="""\
lagcli: 1
particles:
  a: {mass: 1, position: [1, 0, 0]}
  b: {mass: 1, position: [a.x + 1, 0, 0]}
""",
        cure="Give the initial value as a number; if the relation holds for ever, state it under `holonomic`.",
        old="a.x + 1",
        new="2",
    ),
    Page(
        code="velocity-not-allowed",
        meaning="Velocities or rates are used where only positions, coordinates and time may.",
        why="A potential V(r, q, t) and a holonomic constraint f(r, q, t) = 0 know no velocities; the method of"
        " multipliers rests on that.",
        example=_BALL + "holonomic:\n  steady: a.vx = 1\n",
        cure="A law in velocities belongs under `differential`; a force that depends on velocity is declared with"
        " `to` and `force`.",
        old="[1, 0, 0]}\nholonomic",
        new="[1, 0, 0], velocity: [1, 0, 0]}\ndifferential",
    ),
    Page(
        code="time-not-allowed",
        meaning="The time `t` is used in an expression that must be constant.",
        why="Parameters, masses and initial values hold for the whole run.",
        example="""\
lagcli: 1
particles:
  a: {mass: 1 + t, position: [1, 0, 0]}
""",
        cure="Use a constant. Time may be used in positions x(q, t), forces, potentials and constraints.",
        old="1 + t",
        new="1",
    ),
    Page(
        code="differential-not-allowed",
        meaning="`d(...)` or `dt` is used outside a differential constraint.",
        why="Differentials have a meaning only as the law that ties them, A dr + A_t dt = 0.",
        example=_BALL + "holonomic:\n  track: d(a.x) = 0\n",
        cure="Move the law to `differential`.",
        old="holonomic",
        new="differential",
    ),
    Page(
        code="result-not-allowed",
        meaning="A multiplier, a reaction, an acceleration, `kinetic` or `potential` is used outside `outputs`.",
        why="They are results of the motion: the multipliers are solved for when all other forces are given. A force"
        " that depends on a constraint force (Coulomb friction, mu times the normal force) does virtual work, so it"
        " is not covered by the principle of d'Alembert (D.11), on which the equations rest.",
        example=_BALL + "holonomic:\n  floor: a.z = 0\nforces:\n"
        '  friction: {to: a, force: "[-0.3*multiplier(floor), 0, 0]"}\n',
        cure="Take it out of the law and record it under `outputs`. Where the normal force is known from the other"
        " forces (m*g on a level floor), write that instead.",
        old='forces:\n  friction: {to: a, force: "[-0.3*multiplier(floor), 0, 0]"}\n',
        new="outputs:\n  grip: 0.3*multiplier(floor)\n",
    ),
    Page(
        code="share-not-determined",
        meaning="`reaction(a, rod)` asks for the force of a constraint on a particle that its equation does not name.",
        why="The particle follows generalized coordinates, and so does the constraint. Its multiplier acts on these"
        " coordinates; which part of it reaches which of the particles that follow them depends on how they are"
        " built, and the model does not say that.",
        example="""\
lagcli: 1
coordinates: {x: {value: 0}, y: {value: 0, rate: 1}}
particles:
  a: {mass: 1, position: "[x, y, 0]"}
holonomic:
  rail: x = 0
outputs:
  push: reaction(a, rail)
""",
        cure="Name the particle in the constraint, or record the multiplier, which is the generalized force.",
        old="rail: x = 0",
        new="rail: a.x = 0",
        stage="start",
    ),
    Page(
        code="no-differential",
        meaning="A law, or a term of it, under `differential` holds no differential and no velocity.",
        why="Every term of A dr + A_t dt = 0 has a differential: what is multiplied by none would be finite among"
        " infinitesimals. A law without any belongs under `holonomic`.",
        example=_KNIFE + "  edge: sin(theta)*d(x) - cos(theta)*d(y) = 1\n",
        cure="Multiply the term by `dt`, or take it out.",
        old="= 1",
        new="= 1*dt",
    ),
    Page(
        code="mixed-forms",
        meaning="One law is written partly in differentials and partly in velocities.",
        why="Terms of the one kind are finite and of the other infinitesimal; they cannot be added.",
        example=_KNIFE + "  edge: sin(theta)*d(x) - cos(theta)*rate(y) = 0\n",
        cure="Write the whole law in one form.",
        old="cos(theta)*rate(y)",
        new="cos(theta)*d(y)",
    ),
    Page(
        code="nonlinear-differential",
        meaning="A law under `differential` is not linear in the differentials or velocities.",
        why="Virtual displacements and multipliers (D.3, D.9) are defined for linear laws, with coefficients of"
        " positions, coordinates and time. For a condition such as constant speed d'Alembert's principle gives no"
        " reaction; Chetaev's rule is one of several proposals, and is not computed. Each term must be linear by"
        " itself: terms that would cancel are not searched for.",
        example=_KNIFE + "  speed: rate(x)**2 + rate(y)**2 = 1\n",
        cure="State a linear law. Where the square came from a length that stays constant, state the length under"
        " `holonomic`; hold a speed by a force; multiply a quotient of velocities by its denominator.",
        old="speed: rate(x)**2 + rate(y)**2",
        new="speed: rate(x)",
    ),
)
