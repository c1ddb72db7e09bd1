"""The sentences of `facts` on what an expression may not hold, and what to do.

A subject is how the error calls the expression, with its article: "a potential", "the force on a particle".
"""

from __future__ import annotations

from collections.abc import Container

from lagcli.expression import functions, hints

# What a name that nothing declares may be meant as.
UNDECLARED = {
    **hints.NAMES,
    "energy": "`energy` is a column of every table, not a name of expressions; under `outputs`, write"
    " `kinetic + potential`",
    **dict.fromkeys(
        ("lambda", "\N{GREEK SMALL LETTER LAMDA}"),
        "multipliers are results: under `outputs` or `events`, and only there, write `multiplier(NAME)`",
    ),
    "r": "`r` is a position inside the force of a particle only: elsewhere write the particle's name, `a` or `a.x`",
    "v": "`v` is a velocity inside the force of a particle only: elsewhere write `a.v` or `a.vx` of a particle `a`",
    "m": "`m` is a mass inside the force of a particle only: elsewhere give the mass a name under `parameters`",
    "R": "constraint forces are results: under `outputs` or `events`, and only there, write `reaction(NAME)`",
    **dict.fromkeys(("nan", "inf", "infinity"), "every number of a model is finite"),
}

NO_ACCELERATION = (
    "accelerations are results: under `outputs` or `events`, and only there, write `a.ax` or `a.a` for a particle,"
    " `rate(theta, 2)` for a coordinate; a law in accelerations is integrated to one in velocities, under"
    " `differential`, or replaced by a force"
)
_DERIVATIVE = (
    "a time derivative is written `rate(x)` for a coordinate, `a.vx` or `a.v` for a particle, `d(...)` in a"
    " differential constraint"
)
_CONSTRAINT_FORCE = (
    "constraint forces are results: under `outputs` or `events`, and only there, write `multiplier(NAME)` or"
    " `reaction(NAME)`"
)

# The same for a function that the format does not have.
UNKNOWN_FUNCTIONS = {
    **{row.written: f"write `{row.name}(x)`" for row in functions.ROWS if row.written},
    **{f"{row.name}d": hints.DEGREE_FUNCTION for row in functions.ROWS if row.angle and row.arguments == 1},
    **hints.FUNCTIONS,
    **dict.fromkeys(("ddot", "acc", "accel", "acceleration"), NO_ACCELERATION),
    **dict.fromkeys(("diff", "der", "derivative", "ddt", "velocity", "speed"), _DERIVATIVE),
    **dict.fromkeys(
        ("tension", "friction", "normal", "normal_force", "force", "constraint_force"), _CONSTRAINT_FORCE
    ),
}
# The same for what follows the dot of a particle.
OTHER_MEMBER = (
    "a particle has `.x .y .z`, `.vx .vy .vz` and the vector `.v`; under `outputs` and `events` also"
    " `.ax .ay .az`, `.a`"
)
_POSITION_VECTOR = "the particle's name alone is its position vector; its components are `.x` `.y` `.z`"
_REACTION = "the constraint force on a particle `a` is `reaction(a)`, under `outputs` or `events` only"
PARTICLE_MEMBERS = {
    **dict.fromkeys(("r", "pos", "position", "p", "xyz", "q"), _POSITION_VECTOR),
    **dict.fromkeys(
        ("vel", "velocity", "speed", "dot", "xdot", "ydot", "zdot", "dx", "dy", "dz"),
        "velocities are `.v`, `.vx` `.vy` `.vz`",
    ),
    **dict.fromkeys(("R", "reaction", "force", "F"), _REACTION),
    **dict.fromkeys(("m", "mass"), "give the mass a name under `parameters` and use that"),
    **dict.fromkeys(("acc", "accel", "acceleration"), NO_ACCELERATION),
}
AT_A_TIME = "a name is its value at the time `t`: write it alone, without parentheses, or `*` for a product"

_DEGREES = {2: "quadratic", 3: "cubic"}
_LONGEST_TERM = 60  # letters of a term that a message quotes

_NONLINEAR = (
    "write a law that is linear, without terms that cancel. A fixed speed, `rate(x)**2 + rate(y)**2 = c`, is no"
    " ideal constraint: d'Alembert's principle gives no reaction for it, and Chetaev's rule is not computed. Hold it"
    " by a force; if a constant length is behind it, state that under `holonomic`"
)
_QUOTIENT = "multiply the law by the denominator, so that each term holds one velocity or differential"
_PER_TIME = "; a differential divided by `dt` is written `rate(x)`, `a.vx`"
_MIXED = "differentials and rates do not mix in one equation"


def nonlinear(term: str, degree: int, kinds: frozenset[str], quotient: bool) -> tuple[str, str]:
    """Message and hint for a term that is not linear in differentials or velocities.

    `kinds`: what it reads, "differential" and "velocity" among it; `quotient`: whether it divides by them.
    """
    mixed = kinds >= {"differential", "velocity"}
    what = "differentials" if "differential" in kinds else "velocities"
    order = "not linear" if term.startswith(("norm(", "distance(")) else _DEGREES.get(degree, "not linear")
    words = "mixes differentials and velocities" if mixed else f"is {order} in the {what}"
    shown = term if len(term) <= _LONGEST_TERM else term[: _LONGEST_TERM - 3] + "..."
    message = (
        f"{f'`{shown}`' if shown else 'a term'} {words}; a differential constraint must be linear in them, term by"
        " term, with coefficients of positions, coordinates and time only"
    )
    if quotient:
        return message, _QUOTIENT + (_PER_TIME if "differential" in kinds else "")
    return message, _MIXED if mixed else _NONLINEAR


def derivative_of(name: str, coordinates: Container[str]) -> str:
    """The text to write for an undeclared `xdot`, `x_dot`, `dx`, `ẋ` where x is a coordinate, or an empty text."""
    plain = hints.dotted(name)
    if plain:
        return f"write `rate({plain})`" if plain in coordinates else _DERIVATIVE
    if (
        name[:1] == "d"
        and name.removesuffix("dt").removesuffix("_")[1:] in coordinates
        and name.endswith("dt")
    ):
        return f"write `rate({name.removesuffix('dt').removesuffix('_')[1:]})`"
    stem = name.removesuffix("dot")
    if stem == name:
        prefixed = name[:1] == "d" and name[1:] in coordinates
        return f"write `rate({name[1:]})`, or `d({name[1:]})` for a differential" if prefixed else ""
    for candidate in (stem, stem.removesuffix("_")):
        if candidate in coordinates:
            return f"write `rate({candidate})`"
        if candidate.endswith("d") and candidate[:-1].removesuffix("_") in coordinates:
            return NO_ACCELERATION
    return ""


def way_out(flag: str, subject: str, written: str) -> str:
    """The advice where an expression may not read `flag`, or an empty text; `written`: the name or call."""
    if flag != "result":
        return next((hint for start, hint in _WAYS_OUT.get(flag, ()) if subject.startswith(start)), "")
    # A result of the motion stands in what determines it.
    if written in ("kinetic", "potential"):
        return "energies follow from the motion and are recorded under `outputs`; write the formula out here"
    record = f"record `{written}` under `outputs`"
    if "force" in subject or "definition" in subject:
        return (
            "a force that depends on a constraint force, such as friction mu*N, does virtual work (D.11) and is not"
            " supported. Where N is known beforehand write its formula: m*g on a level floor, m*g*cos(alpha) on a"
            " slope, with `tanh(v/1e-3)` for its direction: with `sign(v)` a run stops where the body comes to rest."
            f" Else only friction of given size, such as -c*v, can be declared; {record}"
        )
    return f"constraint forces follow from the laws and the forces, and may not enter them; {record}"


_CONSTANT = "parameters, masses and initial values are numbers: write its value at the start"
_RESTITUTION = (
    "a coefficient of restitution",
    "it is a number, the same at all impacts of a contact: an expression of parameters and indices",
)

_WAYS_OUT: dict[str, tuple[tuple[str, str], ...]] = {
    "acceleration": (
        ("a parameter", _CONSTANT),
        ("a mass", _CONSTANT),
        ("an initial", _CONSTANT),
        (
            "the force",
            "move the part with the acceleration into the mass: (m + k) a = F instead of m a = F - k a",
        ),
        ("a generalized", "put the part with the acceleration into `lagrangian`, as kinetic energy"),
        ("", NO_ACCELERATION),
    ),
    "velocity": (
        ("a holonomic", "a law in velocities belongs under `differential`"),
        (
            "a one-sided",
            "one-sided constraints are on positions: g(r, q, t) >= 0. Where a velocity crosses a value a run is"
            " stopped, or a row recorded, under `events`",
        ),
        ("a potential", "a force that depends on velocities is declared with `to:` and `force:`"),
        ("the position", "a position is x(q, t); a law in velocities belongs under `differential`"),
        ("a differential `d(", NO_ACCELERATION),
        _RESTITUTION,
        ("", _CONSTANT),
    ),
    "position": (
        _RESTITUTION,
        ("a mass", "a mass that varies is not part of these equations: give its mean, or split the body"),
        ("", _CONSTANT),
    ),
    "cartesian": (
        ("the position", "a relation to a Cartesian particle is a constraint: state it under `holonomic`"),
    ),
    "time": (
        _RESTITUTION,
        (
            "a mass",
            "m a = F + R holds for constant masses: give the mass at the start, and the thrust of a rocket as a"
            " force",
        ),
        ("", _CONSTANT),
    ),
    "differential": (
        (
            "a differential `d(",
            "a differential of a differential has no meaning in a constraint: write one `d`",
        ),
        ("a one-sided", "it is written in positions: take the `d(...)` away"),
        ("a definition", "write the differentials in the law itself, or name a rate instead"),
        ("", "differentials belong under `differential`; a time derivative is written `rate(x)`"),
    ),
}
