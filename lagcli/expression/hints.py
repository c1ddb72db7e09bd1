"""Hints for notations of other programs, of paper, for numbers with units, and for what an expression may not hold: a
sentence, or an empty text. Most words with their sentences stand in `errors/meant.toml`."""

from __future__ import annotations

import functools
import re
import unicodedata
from collections.abc import Collection, Container

from lagcli.errors import diagnostics

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
_QUOTED_UNIT = re.compile(r"(?:[0-9]|[0-9]\.)\s*([A-Za-z]+)(?:\s*[*/·⋅ ]\s*[A-Za-z]+)*\s*$")
_LAST_NAME = re.compile(r"([^\W\d]\w*)\.?([xyz]?)$")
_LAST_NUMBER = re.compile(r"([0-9.]+)\s*$")
NO_ACCELERATION = (
    "accelerations are results: under `outputs` or `events`, and only there, write `a.ax` or `a.a` for a particle,"
    " `rate(theta, 2)` for a coordinate; a law in accelerations is integrated to one in velocities, under"
    " `differential`, or replaced by a force"
)
_ACCELERATIONS = ("acc", "accel", "acceleration")
_OTHER_MEMBER = (
    "a particle has `.x .y .z`, `.vx .vy .vz` and the vector `.v`; under `outputs` and `events` also"
    " `.ax .ay .az`, `.a`"
)
AT_A_TIME = "a name is its value at the time `t`: write it alone, without parentheses, or `*` for a product"

_ORDERS = {2: "quadratic", 3: "cubic"}
_LONGEST_TERM = 60  # letters of a term that a message quotes

_NONLINEAR = (
    "write a law that is linear, without terms that cancel. A fixed speed, `rate(x)**2 + rate(y)**2 = c`, is no"
    " ideal constraint: d'Alembert's principle gives no reaction for it, and Chetaev's rule is not computed. Hold it"
    " by a force; if a constant length is behind it, state that under `holonomic`"
)


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
    return diagnostics.meant("characters of formulas").get(sign, "")


@functools.cache
def _common_functions() -> frozenset[str]:
    from lagcli.expression import functions  # here, as what loads no numbers reads formulas too

    return functions.named(lambda row: row.arguments == 1)


def between(before: tuple[str, str], token: tuple[str, str], earlier: tuple[str, str]) -> str:
    """For two things without an operator between them; each is (kind, text), `earlier` stands before `before`."""
    kind, text = before
    following, word = token
    if kind == "number":
        if following == "number":
            one = "a number is written without spaces; the components of a vector have commas between them"
            return "a number has one decimal point" if word.startswith(".") else one
        if following != "name":
            power = "; a power of a function is written `sin(x)**2`" if earlier[0] == "**" else ""
            return f"write `*` for a product{power}"
        if word in _DEGREES:
            return f"angles are in radians: write `{text}*deg`"
        if word in _RADIANS:
            return _IN_RADIANS
        if word in _CERTAIN_UNITS:
            return NO_UNITS
        if word in _UNITS:
            return f"{NO_UNITS}; a product is written `{text}*{word}`"
        if word.startswith("_") or re.fullmatch(r"[xXbBoO][0-9a-fA-F]+", word):
            return "numbers are written in decimals, without `_`: `10000`, `1e4`"
        return f"write `*` for a product: `{text}*{word}`"
    if following == "(" and kind == "name" and earlier[0] == ".":
        if text in _common_functions():
            return f"functions are written without a prefix: `{text}(...)`"
        return "a component is its value at the time `t`: write it without parentheses"
    if kind == "name" and text in _common_functions() | {"rate"} and following in ("name", "number"):
        return f"arguments are in parentheses: `{text}({word})`"
    if (kind, text) == ("name", "d") and following == "name":
        return f"a differential is written `d({word})`"
    if following == "name" and word in ("x", "X"):
        return "write `*` for a product, `cross(u, w)` for that of two vectors"
    if kind in ("name", ")", "]") and following == "name" and word in _CERTAIN_UNITS:
        return NO_UNITS
    return "write `*` for a product"


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
    return ONE_SIDED if in_equation else diagnostics.meant("characters of formulas")["?"]


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
    way = {">": "up", "<": "down"}.get(sign[0], "")
    more = f", and `direction: {way}` beside it" if way else ""
    return f"write left - right, such as `a.z - 1`{more}"


def vector(count: int) -> str:
    """For a vector of another number of components than three."""
    if count == 2:
        return "in a plane add a third component `0`, and a constraint such as `a.z = 0` if the particle can leave it"
    if count > 3:
        return "numbers have a decimal point: `0.5`, not `0,5`"
    return "commas separate the components: `[1, 0, 0]`" if count == 1 else ""


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


def undeclared(name: str) -> str:
    """For a name that nothing declares: what it may be meant as."""
    if name in _CERTAIN_UNITS:
        return NO_UNITS
    if name in _RADIANS:
        return _IN_RADIANS
    if name in _DEGREES - {"deg", "°"}:
        return "angles are in radians, and `deg` is pi/180: `30*deg`"
    return diagnostics.meant("names of formulas").get(name, "")


def unknown_function(name: str) -> str:
    """For a function that the format does not have."""
    from lagcli.expression import functions  # here, as what loads no numbers reads formulas too

    known = diagnostics.meant("functions of formulas")
    if name in known:
        return known[name]
    if name in (*_ACCELERATIONS, "ddot"):
        return NO_ACCELERATION
    for row in functions.ROWS:
        if name == row.written:
            return f"write `{row.name}(x)`"
        if name == f"{row.name}d" and row.angle and row.arguments == 1:
            return known["degrees"]
    return ""


def particle_member(member: str) -> str:
    """For what follows the dot of a particle."""
    if member in _ACCELERATIONS:
        return NO_ACCELERATION
    return diagnostics.meant("members of particles").get(member, _OTHER_MEMBER)


def nonlinear(term: str, degree: int, kinds: frozenset[str], quotient: bool) -> tuple[str, str]:
    """Message and hint for a term that is not linear in differentials or velocities. `kinds`: what it reads,
    "differential" and "velocity" among it; `quotient`: whether it divides by them."""
    mixed = kinds >= {"differential", "velocity"}
    what = "differentials" if "differential" in kinds else "velocities"
    order = "not linear" if term.startswith(("norm(", "distance(")) else _ORDERS.get(degree, "not linear")
    words = "mixes differentials and velocities" if mixed else f"is {order} in the {what}"
    shown = term if len(term) <= _LONGEST_TERM else term[: _LONGEST_TERM - 3] + "..."
    message = (
        f"{f'`{shown}`' if shown else 'a term'} {words}; a differential constraint must be linear in them, term by"
        " term, with coefficients of positions, coordinates and time only"
    )
    if quotient:
        hint = "multiply the law by the denominator, so that each term holds one velocity or differential"
        per_time = "; a differential divided by `dt` is written `rate(x)`, `a.vx`"
        return message, hint + (per_time if "differential" in kinds else "")
    return message, "differentials and rates do not mix in one equation" if mixed else _NONLINEAR


def derivative_of(name: str, coordinates: Container[str]) -> str:
    """The text to write for an undeclared `xdot`, `x_dot`, `dx`, `ẋ` where x is a coordinate, or an empty text."""
    # `ẋ` without its dots.
    parts = unicodedata.normalize("NFD", name)
    plain = "".join(c for c in parts if c not in "\u0307\u0308")
    if plain != parts:
        known = f"write `rate({plain})`" if plain in coordinates else ""
        return known or diagnostics.meant("functions of formulas")["derivative"]
    above = name.removesuffix("dt").removesuffix("_")[1:]
    if name[:1] == "d" and above in coordinates and name.endswith("dt"):
        return f"write `rate({above})`"
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
    """The advice where an expression may not read `flag`, or an empty text; `written`: the name or call. A subject is
    how the error calls the expression, with its article: "a potential", "the force on a particle"."""
    if flag != "result":
        if flag == "velocity" and subject.startswith("a differential `d("):
            return NO_ACCELERATION
        ways = diagnostics.meant(f"ways out of {flag}").items()
        found = next((hint for start, hint in ways if subject.startswith(start)), "")
        return NO_ACCELERATION if flag == "acceleration" and not found else found
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
