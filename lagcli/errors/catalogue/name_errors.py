"""Codes of names: who may bear which, and what they may stand for."""

from __future__ import annotations

from lagcli.errors.catalogue.page import Page

_BALL = """\
lagcli: 1
particles:
  a: {mass: 1, position: [1, 0, 0]}
"""

PAGES = (
    Page(
        code="bad-name",
        meaning="A name has characters it may not have, or is a word the format or the table needs itself.",
        why="A name is a letter or `_`, then letters, digits and `_`, so that it can be used in expressions. `t`,"
        " `dt`, `pi`, `kinetic` and `potential` are taken; `all`, `lambda`, `R`, `energy` and `err` would make two"
        " columns of one name.",
        example="""\
lagcli: 1
particles:
  ball-1: {mass: 1, position: [1, 0, 0]}
""",
        cure="Choose another name.",
        old="ball-1",
        new="ball_1",
    ),
    Page(
        code="duplicate-name",
        meaning="Two things have the same name.",
        why="Particles, coordinates, parameters, definitions and outputs share one namespace, and so do all"
        " constraints: a name in an expression or at the head of a column must mean one thing.",
        example="""\
lagcli: 1
parameters: {a: 2}
particles:
  a: {mass: 1, position: [1, 0, 0]}
""",
        cure="Rename one of them.",
        old="{a: 2}",
        new="{scale: 2}",
    ),
    Page(
        code="unknown-name",
        meaning="An expression or a list uses a name that nothing declares.",
        why="Most often it is misspelt, or its parameter has not been declared. No constants but `pi` and `deg`"
        " (pi/180) are built in, not even g.",
        example=_BALL + "holonomic:\n  rod: norm(a) = L\n",
        cure="Declare it, or use the name the hint gives.",
        old="lagcli: 1\n",
        new="lagcli: 1\nparameters: {L: 1}\n",
    ),
    Page(
        code="angle-in-degrees",
        meaning="A number larger than a full turn in radians is used as an angle.",
        why="`sin`, `cos` and `tan` take radians. A parameter or a start such as 30 is possible there, but most often"
        " degrees were meant. This is a note: nothing is changed, and `check --strict` passes.",
        example="""\
lagcli: 1
parameters: {alpha: 30}
particles:
  a: {mass: 1, position: [0, 0, 0]}
holonomic:
  slope: a.z*cos(alpha) = a.x*sin(alpha)
""",
        cure="Write degrees as `30*deg`. Where radians are meant, leave it, or write the number as a multiple of pi.",
        old="alpha: 30",
        new="alpha: 30*deg",
        severity="note",
    ),
    Page(
        code="unknown-component",
        meaning="The word after the dot is not a component of what is before it.",
        why="A particle has `.x` `.y` `.z`, `.vx` `.vy` `.vz` and the vector `.v`, under `outputs` also `.ax` `.ay`"
        " `.az` and `.a`; any other vector has `.x` `.y` `.z`.",
        example=_BALL + "outputs:\n  height: a.h\n",
        cure="Use one of the components there are.",
        old="a.h",
        new="a.z",
    ),
    Page(
        code="unknown-function",
        meaning="The format has no function of this name.",
        why="Expressions are data and can call only the functions of the format: `sin cos tan asin acos atan atan2"
        " sinh cosh tanh exp log sqrt abs sign min max`, `dot cross norm distance`, and `rate`, `d`, `multiplier`,"
        " `reaction`.",
        example=_BALL + "outputs:\n  length: length(a)\n",
        cure="Use a function that exists.",
        old="length(a)",
        new="norm(a)",
    ),
    Page(
        code="unknown-constraint",
        meaning="`multiplier(...)` names no constraint of the model.",
        why="Multipliers belong to the entries of `holonomic`, `rigid` and `differential`, and are called by their"
        " names.",
        example=_BALL + "holonomic:\n  floor: a.z = 0\noutputs:\n  push: multiplier(flor)\n",
        cure="Name the constraint.",
        old="flor)",
        new="floor)",
    ),
    Page(
        code="used-before-declared",
        meaning="A parameter, definition or output is used above the line that declares it.",
        why="Parameters, definitions and outputs use earlier ones only, so that a file can be read from top to"
        " bottom and no two can depend on each other.",
        example="""\
lagcli: 1
parameters:
  weight: m*9.81
  m: 2
particles:
  a: {mass: m, position: [1, 0, 0]}
""",
        cure="Change the order.",
        old="  weight: m*9.81\n  m: 2\n",
        new="  m: 2\n  weight: m*9.81\n",
    ),
    Page(
        code="circular",
        meaning="The position of a particle depends on itself, by way of other particles or definitions.",
        why="Positions x(q, t) are substituted into each other, which never ends in a circle.",
        example="""\
lagcli: 1
coordinates:
  s: {value: 0}
particles:
  a: {mass: 1, position: [b.x + s, 0, 0]}
  b: {mass: 1, position: [a.x - s, 0, 0]}
""",
        cure="State one position in coordinates alone. A condition that both must meet is a constraint.",
        old="a.x - s",
        new="-s",
    ),
    Page(
        code="shadowed-name",
        severity="warning",
        meaning="Inside the force on a particle `m`, `r` and `v` are the particle's own mass, position and velocity,"
        " and the model has something else of that name.",
        why="The force uses the particle's own value; where you meant the other one, the result is wrong.",
        example="""\
lagcli: 1
parameters: {v: 3}
particles:
  a: {mass: 1, position: [1, 0, 0]}
forces:
  drag: {to: a, force: -2*v}
""",
        cure="Rename the parameter; the particle's own velocity is meant here.",
        old="{v: 3}",
        new="{wind_speed: 3}",
    ),
)
