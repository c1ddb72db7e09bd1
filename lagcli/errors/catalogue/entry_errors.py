"""Codes of sections and entries: keys, fields and what may stand under them."""

from __future__ import annotations

from lagcli.errors.catalogue.page import Page

_BALL = """\
lagcli: 1
particles:
  a: {mass: 1, position: [1, 0, 0]}
"""

PAGES = (
    Page(
        code="unknown-version",
        meaning="The file states a version of the format that this program does not read.",
        why="The meaning of a model is fixed by its version; a file of another version could be misread.",
        example=_BALL.replace("lagcli: 1", "lagcli: 2"),
        cure="State version 1, or use a program that knows the other one.",
        old="lagcli: 2",
        new="lagcli: 1",
    ),
    Page(
        code="unknown-key",
        meaning="A section or field has a name that the format does not know.",
        why="A misspelt key would otherwise be skipped in silence, and the model would be another one than you"
        " think.",
        example="""\
lagcli: 1
particles:
  a: {mass: 1, position: [1, 0, 0], velocty: [0, 1, 0]}
""",
        cure="Use the name the hint gives, or look it up in the reference of the format.",
        old="velocty",
        new="velocity",
    ),
    Page(
        code="missing-key",
        meaning="A key without which the entry has no meaning is absent.",
        why="There is no sensible default for it: a particle without a mass, a force without a target, a file"
        " without its version.",
        example="""\
lagcli: 1
particles:
  a: {position: [1, 0, 0]}
""",
        cure="Add the key.",
        old="{position",
        new="{mass: 1, position",
    ),
    Page(
        code="conflicting-keys",
        meaning="Two keys are given that exclude each other.",
        why="A potential acts on everything it depends on, so it takes no `to` and no `force`; `samples` and"
        " `output_step` both set the times of the rows.",
        example=_BALL + "simulation: {duration: 10, samples: 101, output_step: 0.1}\n",
        cure="Keep one of them.",
        old=", output_step: 0.1",
    ),
    Page(
        code="missing-value",
        meaning="A key has nothing after its colon, or a list is empty.",
        why="An expression or a name is needed there; nothing is taken for granted.",
        example=_BALL + "outputs:\n  height:\n",
        cure="Write the value.",
        old="height:",
        new="height: a.z",
    ),
    Page(
        code="not-an-expression",
        meaning="A list or a mapping is written where one expression is needed.",
        why="YAML reads an unquoted text that begins with `[` as a list and one that begins with `{` as a mapping.",
        example=_BALL + "outputs:\n  twice: [2*a.x, 0, 0]\n",
        cure="Put the expression in quotes.",
        old="[2*a.x, 0, 0]",
        new='"[2*a.x, 0, 0]"',
    ),
    Page(
        code="not-a-text",
        meaning="A list or a mapping is written where a text is needed.",
        why="Titles, descriptions and labels of units are single texts. A text with `: ` in it needs quotes.",
        example=_BALL + "title: [Ball, alone]\n",
        cure="Write one text.",
        old="[Ball, alone]",
        new="Ball, alone",
    ),
    Page(
        code="not-a-list",
        meaning="A rigid body is given as something else than a list of particles.",
        why="A body is its particles in order: the first that span it become its base, and the order fixes the"
        " names of its multipliers.",
        example="""\
lagcli: 1
particles:
  a: {mass: 1, position: [1, 0, 0]}
  b: {mass: 1, position: [2, 0, 0]}
rigid:
  stick: a, b
""",
        cure="Write the names in square brackets.",
        old="a, b\n",
        new="[a, b]\n",
    ),
    Page(
        code="not-a-name",
        meaning="A list of names holds something that is no name.",
        why="`to:`, `keep:` and rigid bodies list names of particles or coordinates, not expressions or lists.",
        example=_BALL + "forces:\n  pull: {to: [[a]], force: [1, 0, 0]}\n",
        cure="List the names alone.",
        old="[[a]]",
        new="[a]",
    ),
    Page(
        code="bad-setting",
        meaning="A setting under `simulation` is outside its bounds.",
        why="A run needs a finite duration that is not negative, at least two rows, positive tolerances and a"
        " known method; anything else could not end, or not start. There is one scheme, `dop853`: an explicit"
        " Runge-Kutta scheme of order 8 with error control, held on the constraints by projection. Implicit schemes"
        " for stiff forces and symplectic ones there are none.",
        example=_BALL + "simulation: {duration: -5}\n",
        cure="Give a value within the bounds that the message states.",
        old="-5",
        new="5",
    ),
    Page(
        code="not-supported-yet",
        meaning="The format has this, and this version of the program does not carry it out.",
        why="An entry that was skipped in silence would change the meaning of the model.",
        example=_BALL + "inequality:\n  floor: a.z >= 0\n",
        cure="Take it out, or state the model without it: a contact that lasts as an equation under `holonomic`, a"
        " wall as a potential that rises steeply, an event as a quantity under `outputs`.",
        old="inequality:\n  floor: a.z >= 0\n",
    ),
    Page(
        code="nothing-to-move",
        meaning="The model has no particles and no coordinates.",
        why="Without a configuration there are no degrees of freedom to count and no motion to compute.",
        example="lagcli: 1\nparameters: {L: 1}\n",
        cure="Declare a particle or a coordinate.",
        old="parameters: {L: 1}\n",
        new=_BALL.removeprefix("lagcli: 1\n"),
    ),
    Page(
        code="mass-not-positive",
        meaning="A mass is zero or negative.",
        why="The equations m_k a_k = F_k + R_k are solved for the accelerations, which a massless particle does"
        " not have.",
        example="""\
lagcli: 1
particles:
  a: {mass: 0, position: [1, 0, 0]}
""",
        cure="Give a positive mass. A massless stick or string is no particle: it is a constraint between the"
        " particles it joins.",
        old="mass: 0",
        new="mass: 0.1",
    ),
    Page(
        code="velocity-of-dependent",
        meaning="A particle whose position is a function of coordinates or time is given a velocity.",
        why="Its velocity is the time derivative of its position and follows from the rates of the coordinates;"
        " a second value could only contradict it.",
        example="""\
lagcli: 1
coordinates:
  s: {value: 0}
particles:
  a: {mass: 1, position: [s, 0, 0], velocity: [1, 0, 0]}
""",
        cure="Give the rate of the coordinate.",
        old="{value: 0}\nparticles:\n  a: {mass: 1, position: [s, 0, 0], velocity: [1, 0, 0]}",
        new="{value: 0, rate: 1}\nparticles:\n  a: {mass: 1, position: [s, 0, 0]}",
    ),
    Page(
        code="not-an-initial-value",
        stage="input",
        meaning="`--set` replaces a position that is a function by a constant, or a constant by a function.",
        why="`--set` changes parameters and initial values. The position of a particle that depends on coordinates"
        " or time is a law of the model, and with another law it would be another model.",
        example="lagcli simulate models/pendulum-angle.yaml --set 'a.position=[0, 0, -1]'",
        cure="Set the coordinate instead, or change the file.",
        new="lagcli simulate models/pendulum-angle.yaml --set theta.value=0",
    ),
    Page(
        code="mixed-targets",
        meaning="One force is to act on particles and on generalized coordinates.",
        why="A force on a particle is a vector; a generalized force on a coordinate is a scalar (a torque, where"
        " the coordinate is an angle). One expression cannot be both.",
        example="""\
lagcli: 1
coordinates:
  s: {value: 0}
particles:
  a: {mass: 1, position: [s, 0, 0]}
forces:
  pull: {to: [a, s], force: [1, 0, 0]}
""",
        cure="Declare two forces.",
        old="[a, s]",
        new="a",
    ),
    Page(
        code="no-particles",
        meaning="A force acts on `all`, and there are no particles.",
        why="`all` stands for all particles, of which there are none; a coordinate must be named.",
        example="""\
lagcli: 1
coordinates:
  theta: {value: 0.1}
lagrangian: rate(theta)**2/2
forces:
  motor: {to: all, force: 1}
""",
        cure="Name the coordinate.",
        old="to: all",
        new="to: theta",
    ),
    Page(
        code="too-few-particles",
        meaning="A rigid body has fewer than two particles.",
        why="One particle is a point and needs nothing to hold it together.",
        example=_BALL + "rigid:\n  body: [a]\n",
        cure="List all particles of the body, or leave it out.",
        old="rigid:\n  body: [a]\n",
    ),
)
