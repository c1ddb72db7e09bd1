"""Hints for notations of other programs, of paper, and for numbers with units.

Each function returns a sentence, or an empty text where nothing is known.
"""

from __future__ import annotations

import functools
import re
import unicodedata
from collections.abc import Collection

_DEGREES = frozenset(("deg", "degs", "degree", "degrees", "Deg", "DEG", "grad", "°"))
_RADIANS = frozenset(("rad", "rads", "radian", "radians", "Rad", "RAD"))
_UNITS = frozenset(
    "m mm cm dm km um nm in ft yd mi kg g mg lb t s ms us min h hr hour hours sec second seconds day days yr"
    " N kN mN Nm J kJ mJ W kW MW Pa kPa MPa bar Hz kHz rpm rps K V A mps kph kmh mph meter meters metre metres gram"
    " grams kilogram kilograms newton newtons".split()
)
_CERTAIN_UNITS = frozenset("kg mm cm km mg ms rpm rps kN mN Nm kJ kW kPa MPa Hz kHz mph kph kmh".split())

NO_UNITS = "numbers carry no unit: convert them to one system; labels go under `units`"
_IN_RADIANS = "angles are in radians: leave the unit out"
ONE_SIDED = "one-sided constraints, with `>=` or `<=`, have an entry under `inequality`"
_NO_CHOICE = (
    "a formula has no conditions: use `sign`, `min`, `max`, `abs`; (1 + sign(t - t0))/2 is 0 before t0"
)
_QUOTED_UNIT = re.compile(r"(?:[0-9]|[0-9]\.)\s*([A-Za-z]+)(?:\s*[*/·⋅ ]\s*[A-Za-z]+)*\s*$")
_LAST_NAME = re.compile(r"([^\W\d]\w*)\.?([xyz]?)$")
_LAST_NUMBER = re.compile(r"([0-9.]+)\s*$")

_CHARACTERS = {
    "^": "write `**` for a power",
    "×": "write `*`, or `cross(u, w)` for vectors",
    **dict.fromkeys("·⋅∙•", "write `*`, or `dot(u, w)` for vectors"),
    "−": "this is a Unicode minus; write `-`",
    **dict.fromkeys("–—‐‑‒―－", "this is a dash; write `-`"),
    **dict.fromkeys("÷∕⁄", "write `/`"),
    "²": "write `**2`",
    "³": "write `**3`",
    **dict.fromkeys("₀₁₂₃₄₅₆₇₈₉", "names have no subscripts: `x1`; a member of a family is `x[1]`"),
    "√": "write `sqrt(...)`",
    "½": "write `1/2`",
    "¼": "write `1/4`",
    "∂": "write `d(x)` for a differential, `rate(x)` for a time derivative",
    "∫": "there are no integrals in a formula: differentiate the law, or add a coordinate for the integral",
    "∞": "every number of a model is finite",
    "&": "conditions are joined with `and`, and are used in `if:` of a family only",
    "|": "write `abs(x)` for |x|, `norm(u)` for |u|",
    **dict.fromkeys("{}", "only round brackets group; `[x, y, z]` is a vector"),
    "≥": "write `>=`",
    "≤": "write `<=`",
    "≠": "write `!=`",
    "!": "write `!=`, or `not`",
    ":": "a range is written `1..N`",
    "…": "write two dots: `1..N`",
    ";": "an entry has one formula and no `;` at its end; the components of a vector have commas between them",
    "%": "there is no remainder of a division; `sin` and `cos` take angles of any size",
    "?": _NO_CHOICE,
    "\\": "names are written without a backslash: `theta`",
    "$": "names are written without `$`",
    "#": "a comment needs a space before the `#`",
    '"': "a formula has no quoted texts inside",
    **dict.fromkeys("“”„‘’", "a formula has no quotes inside"),
    **dict.fromkeys("\u200b\u200c\u200d\u2060\ufeff", "this is an invisible character: delete it"),
    **dict.fromkeys("，、", "this is a comma of another script; write `,`"),
    **dict.fromkeys("（）", "this is a bracket of another script; write `(` and `)`"),
}


def character(text: str, at: int) -> str:
    """For a character that has no meaning, at its offset in the text."""
    sign, before = text[at], text[:at].rstrip()
    if sign in "°º˚":
        number = _LAST_NUMBER.search(before)
        return f"angles are in radians: write `{number[1] if number else '30'}*deg`"
    if sign == "^":
        unit, function = _QUOTED_UNIT.search(before), _LAST_NAME.search(before)
        if unit and unit[1] in _UNITS:
            return NO_UNITS
        if function and function[1] in _common_functions():
            return f"a power of a function is written `{function[1]}(x)**2`"
    if sign in "'′’":
        found = _LAST_NAME.search(before)
        if found is None:
            return "a time derivative is written `rate(x)`; a formula has no quoted texts inside"
        if found[0] != found[1]:
            return f"a time derivative is written with `v`: `{found[1]}.v{found[2]}`"
        return f"a time derivative is written `rate({found[1]})`, of a particle `{found[1]}.v`"
    if sign == ":" and text[at + 1 : at + 2] == "=":
        return "write `=`"
    if sign in "µμ" or unicodedata.combining(sign):
        return "a time derivative is written `rate(x)`"
    return _CHARACTERS.get(sign, "")


@functools.cache
def _common_functions() -> frozenset[str]:
    """The names of the functions of one number."""
    from lagcli.expression import functions  # here, as what loads no numbers reads formulas too

    return functions.named(lambda row: row.arguments == 1)


def between(before: tuple[str, str], token: tuple[str, str], earlier: tuple[str, str]) -> str:
    """For two things without an operator between them; each is (kind, text), `earlier` stands before `before`."""
    kind, text = before
    if kind == "number":
        return _after_number(text, token, earlier)
    if token[0] == "(" and kind == "name" and earlier[0] == ".":
        if text in _common_functions():
            return f"functions are written without a prefix: `{text}(...)`"
        return "a component is its value at the time `t`: write it without parentheses"
    if kind == "name" and text in _common_functions() | {"rate"} and token[0] in ("name", "number"):
        return f"arguments are in parentheses: `{text}({token[1]})`"
    if (kind, text) == ("name", "d") and token[0] == "name":
        return f"a differential is written `d({token[1]})`"
    if token in (("name", "x"), ("name", "X")):
        return "write `*` for a product, `cross(u, w)` for that of two vectors"
    if kind in ("name", ")", "]") and token[0] == "name" and token[1] in _CERTAIN_UNITS:
        return NO_UNITS
    return "write `*` for a product"


def _after_number(number: str, token: tuple[str, str], earlier: tuple[str, str]) -> str:
    kind, word = token
    if kind == "number":
        one = "a number is written without spaces; the components of a vector have commas between them"
        return "a number has one decimal point" if word.startswith(".") else one
    if kind != "name":
        power = "; a power of a function is written `sin(x)**2`" if earlier[0] == "**" else ""
        return f"write `*` for a product{power}"
    if word in _DEGREES:
        return f"angles are in radians: write `{number}*deg`"
    if word in _RADIANS:
        return _IN_RADIANS
    if word in _CERTAIN_UNITS:
        return NO_UNITS
    if word in _UNITS:
        return f"{NO_UNITS}; a product is written `{number}*{word}`"
    if word.startswith("_") or re.fullmatch(r"[xXbBoO][0-9a-fA-F]+", word):
        return "numbers are written in decimals, without `_`: `10000`, `1e4`"
    return f"write `*` for a product: `{number}*{word}`"


def comma(before: tuple[str, str], number: str) -> str:
    """For a comma outside of brackets; `number` is what follows it."""
    if before[0] == "number" and number.isdigit():
        return f"a decimal point is written `.`: `{before[1]}.{number}`"
    return "a vector is written `[x, y, z]`; each equation or formula has an entry of its own"


def relation(sign: str, in_equation: bool) -> str:
    """For `>=`, `==` and their like where they have no place."""
    if sign == "==":
        return "write `=`" if in_equation else "a formula has one value and no `==`"
    if sign == "!=":
        return "an equation has one `=`"
    return ONE_SIDED if in_equation else _NO_CHOICE


def condition(sign: str, is_second: bool, after: str) -> tuple[str, str]:
    """Message and hint for a sign or word that a condition may not have; `after`: the text of the next token."""
    if sign == "or":
        return "a condition is one relation", "one of two is enough where the larger is: `max(g, h) >= 0`"
    if is_second or sign in ("and", "not"):
        return "a condition is one relation", "each condition has an entry of its own: `x >= 0`, and `x <= 1`"
    if sign in (">", "<"):
        message = f"`{sign}` is strict, and a one-sided constraint holds its boundary too: there it acts"
        return message, f"write `{sign}=`"
    if sign == "=" and after in (">", "<"):
        return f"`={after}` is no relation", f"write `{after}=`"
    if sign == "!=":
        return "`!=` is no one-sided constraint", "it has `>=` or `<=`"
    message = f"`{sign}` holds on both sides, and a one-sided constraint has `>=` or `<=`"
    return message, "an equation belongs under `holonomic`"


def crossing(sign: str) -> str:
    """For a relation where an event has its expression."""
    way = {
        ">": "`direction: up`",
        ">=": "`direction: up`",
        "<": "`direction: down`",
        "<=": "`direction: down`",
    }
    more = f", and {way[sign]} beside it" if sign in way else ""
    return f"write left - right, such as `a.z - 1`{more}"


NAMES = {
    **dict.fromkeys(_DEGREES - {"deg", "°"}, "angles are in radians, and `deg` is pi/180: `30*deg`"),
    **dict.fromkeys(_RADIANS, _IN_RADIANS),
    **dict.fromkeys(_CERTAIN_UNITS, NO_UNITS),
    **dict.fromkeys(("e", "E", "ℯ"), "the exponential function is `exp(x)`"),
    **dict.fromkeys(("PI", "Pi", "π", "M_PI"), "write `pi`"),
    **dict.fromkeys(("time", "Time"), "time is `t`"),
    **dict.fromkeys(
        ("KE", "Ekin", "E_kin", "kinetic_energy"), "write `kinetic`, under `outputs` or `events` only"
    ),
    **dict.fromkeys(
        ("PE", "Epot", "E_pot", "potential_energy"), "write `potential`, under `outputs` or `events` only"
    ),
    "T": "time is `t`; the kinetic energy is `kinetic`, under `outputs` or `events` only",
    "V": "the potential energy is `potential`, under `outputs` or `events` only",
    **dict.fromkeys(
        ("math", "Math", "np", "numpy", "sp", "sympy", "ca", "casadi", "torch"),
        "functions and constants are written without a prefix: `sin(x)`, `pi`",
    ),
    **dict.fromkeys(("true", "false", "True", "False"), "a formula has numbers only"),
}

_NORM = "the length of a vector is `norm(u)`"
_ROUNDING = "there is no rounding of numbers in a formula"
DEGREE_FUNCTION = "angles are in radians, and `deg` is pi/180: `30*deg`, `sin(x*deg)`, `angle/deg`"
FUNCTIONS = {
    **dict.fromkeys(("mag", "magnitude", "length", "len", "modulus", "vecnorm", "norm2", "hypot3"), _NORM),
    **dict.fromkeys(("ln", "Ln", "LN"), "the natural logarithm is `log(x)`"),
    **dict.fromkeys(("log10", "lg"), "write `log(x)/log(10)`"),
    "log2": "write `log(x)/log(2)`",
    **dict.fromkeys(("sqr", "square"), "a square is `x**2`, a square root `sqrt(x)`"),
    **dict.fromkeys(("pow", "power"), "a power is `x**y`"),
    "root": "a root is `x**(1/n)`",
    "cbrt": "a cube root is `sign(x)*abs(x)**(1/3)`",
    "hypot": "write `sqrt(x**2 + y**2)`, or `norm([x, y, z])`",
    "arctan2": "write `atan2(x)`",
    "sec": "write `1/cos(x)`",
    **dict.fromkeys(("csc", "cosec"), "write `1/sin(x)`"),
    **dict.fromkeys(("cot", "cotan", "ctg"), "write `1/tan(x)`"),
    **dict.fromkeys(("asinh", "arsinh", "arcsinh"), "write `log(x + sqrt(x**2 + 1))`"),
    **dict.fromkeys(("acosh", "arcosh", "arccosh"), "write `log(x + sqrt(x**2 - 1))`"),
    **dict.fromkeys(("atanh", "artanh", "arctanh"), "write `log((1 + x)/(1 - x))/2`"),
    **dict.fromkeys(("sgn", "signum"), "write `sign(x)`"),
    **dict.fromkeys(("fabs", "Abs"), "write `abs(x)`"),
    **dict.fromkeys(("heaviside", "Heaviside", "step", "stepfun", "unitstep"), "write `(1 + sign(x))/2`"),
    **dict.fromkeys(("floor", "ceil", "round", "trunc", "int"), _ROUNDING),
    **dict.fromkeys(("mod", "fmod", "rem"), _CHARACTERS["%"]),
    **dict.fromkeys(("if", "ite", "iif", "where", "ifelse", "Piecewise", "piecewise", "cond"), _NO_CHOICE),
    **dict.fromkeys(("clip", "clamp", "saturate", "sat"), "write `min(max(x, low), high)`"),
    **dict.fromkeys(("deg", "degree", "degrees", "radians", "deg2rad", "rad", "rad2deg"), DEGREE_FUNCTION),
    **dict.fromkeys(("vec", "vector", "Vector", "array", "tuple", "list"), "a vector is written `[x, y, z]`"),
    **dict.fromkeys(("inner", "scalar_product", "vdot"), "the scalar product is `dot(u, w)`"),
    **dict.fromkeys(("dist", "d2"), "write `distance(u, w)`"),
    **dict.fromkeys(("pos", "position", "r"), "the name of a particle alone is its position vector"),
    **dict.fromkeys(("vel", "v"), "the velocity of a particle `a` is `a.v`, of a coordinate `rate(theta)`"),
    **dict.fromkeys(
        ("lambda", "lam", "lagrange", "mult", "λ"),
        "write `multiplier(NAME)`, under `outputs` or `events` only",
    ),
    **dict.fromkeys(("R", "reac", "reactions"), "write `reaction(NAME)`, under `outputs` or `events` only"),
    **dict.fromkeys(("sum", "prod", "mean"), "there is no sum over members: write out its terms"),
    **dict.fromkeys(
        ("kinetic", "potential"), "write it without parentheses, under `outputs` or `events` only"
    ),
    **dict.fromkeys(("integral", "integrate", "int_"), _CHARACTERS["∫"]),
    **dict.fromkeys(
        ("grad", "gradient", "jacobian"), "gradients are taken by the program: write the function"
    ),
    **dict.fromkeys(("dt", "d_dt"), "a time derivative is written `rate(x)`"),
}

# Of functions that are there, called with another number of arguments.
ARGUMENTS = {
    "dot": "`dot(u, w)` is the scalar product of two vectors; a time derivative is written `rate(theta)`",
    "cross": "`cross(u, w)` is the vector product of two vectors",
    "norm": "`norm(u)` is the length of one vector; between two points write `distance(u, w)`",
    "distance": "`distance(u, w)` is taken between two points; the length of one vector is `norm(u)`",
    "atan": "the angle of a point is `atan2(y, x)`",
    "atan2": "the angle of a point is `atan2(y, x)`",
    "log": "a logarithm to another base is `log(x)/log(base)`",
    "rate": "`rate(theta)` is the rate of a coordinate, `rate(theta, 2)` its acceleration",
    "reaction": "`reaction(a)` is the constraint force on a particle, `reaction(a, rod)` the part of one constraint",
    "multiplier": "`multiplier(rod)` is the multiplier of one constraint",
    "d": "a differential has one argument: `d(x)`",
}


def vector(count: int) -> str:
    """For a vector of another number of components than three."""
    if count == 2:
        return "in a plane add a third component `0`, and a constraint such as `a.z = 0` if the particle can leave it"
    if count > 3:
        return "numbers have a decimal point: `0.5`, not `0,5`"
    return "commas separate the components: `[1, 0, 0]`" if count == 1 else ""


_VELOCITY = (
    "the velocity of a coordinate is `rate({0})`, its acceleration `rate({0}, 2)` under `outputs` or `events`"
)
_VALUE = "the name alone is the value: `{0}`"
_OF_COORDINATE = {
    **dict.fromkeys(
        ("rate", "dot", "v", "vel", "velocity", "speed", "vx", "d", "ddot", "a", "acc"), _VELOCITY
    ),
    **dict.fromkeys(("value", "q", "pos", "position", "x", "val"), _VALUE),
}


def coordinate_member(name: str, member: str) -> str:
    """For `theta.dot` and its like."""
    return _OF_COORDINATE.get(member, "a coordinate is a number and has no components").format(name)


_PARTS = "(v?[xyz]|a[xyz]|v|r|a)"
_PART_AFTER = re.compile(rf"(\w+?)_?{_PARTS}$")
_PART_BEFORE = re.compile(rf"{_PARTS}_?(\w+)$")


def part_of(name: str, particles: Collection[str], laws: Collection[str] = ()) -> str:
    """For `a_x`, `xa`, `v_a`, `R_a`, `lambda_rod`, where `a` is a particle and `rod` a constraint."""
    if name in ("x", "y", "z", "vx", "vy", "vz") and particles:
        return f"a component needs its particle: `{min(particles)}.{name}`"
    if name[:1] == "d" and name[1:] in particles:
        return f"a differential is written `d({name[1:]}.x)`, a velocity `{name[1:]}.vx`"
    if name in ("dx", "dy", "dz") and particles:
        return f"a differential is written `d({min(particles)}.{name[1]})`"
    after, before = _PART_AFTER.match(name), _PART_BEFORE.match(name)
    splits = [(after[1], after[2])] if after else []
    splits += [(before[2], before[1])] if before else []
    for owner, part in splits:
        if owner in particles:
            return f"write `{owner}`" if part == "r" else f"write `{owner}.{part}`"
    for prefix in ("R_", "R", "reaction_", "F_"):
        if name.startswith(prefix) and name[len(prefix) :] in particles:
            return f"write `reaction({name[len(prefix) :]})`, under `outputs` or `events` only"
    for prefix in ("lambda_", "lam_", "lambda", "λ_", "multiplier_"):
        if name.startswith(prefix) and name[len(prefix) :] in laws:
            return f"write `multiplier({name[len(prefix) :]})`, under `outputs` or `events` only"
    return ""


def second_dot(owner: str, member: str, further: str) -> str:
    """For `R.a.x` and `a.v.x`: a second dot after a name."""
    if owner == "R":
        return f"write `reaction({member}).{further}`, under `outputs` or `events` only"
    if owner == "lambda":
        return f"write `multiplier({member}.{further})`, under `outputs` or `events` only"
    if member in ("v", "a") and further in ("x", "y", "z"):
        return f"write `{owner}.{member}{further}`"
    return ""


def dotted(name: str) -> str:
    """The letters of a name with dots over them, `ẋ`, without the dots; an empty text where there are none."""
    parts = unicodedata.normalize("NFD", name)
    plain = "".join(c for c in parts if c not in "\u0307\u0308")
    return plain if plain != parts else ""
