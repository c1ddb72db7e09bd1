"""Random differential systems whose verdict is known by construction: normal forms, hidden.

Parts of known count are put side by side in coordinates u: integrals du = 0, contact forms du - v dw, hidden
conditions, coefficients that nearly vanish, and places that the rows keep to or lead away from, from on them and from
beside them. Then the coordinates are changed by a triangular map u = U(x), the rows mixed by a regular matrix of
functions, and multiplied by factors and gains. Starts are decimals, fractions and expressions.
"""

from __future__ import annotations

import random
from dataclasses import dataclass, field

import sympy

DT = sympy.Symbol("dt")
Form = dict[sympy.Symbol, sympy.Expr]
NAMES = "x y z w u v p q r s".split()
NEARLY = {  # coefficients g(a) that vanish nowhere near these values, and are far below their terms
    "sqrt(a**2 + 1e-12) - a": "3",
    "sqrt(a**2 + 1e-26) - a": "0.4",
    "log(1 + exp(-a))": "25",
    "1 - tanh(a)": "18",
    "cos(a) - 1 + a**2/2 - a**4/24": "0.01",
    "a - sin(a)": "1e-5",
    "exp(a) - exp(a + 1e-13)": "1",
}
# (g, a value at which it is zero, one beside it)
ZEROS = [
    ("a - 1", "1", "1 + 1e-12"),
    ("2*cos(a) - 1", "pi/3", "1.0471975511966"),
    ("3*a - 1", "1/3", "0.333333333333"),
    ("a**2 - 2", "sqrt(2)", "1.41421356237"),
    ("a", "0", "1e-13"),
    ("sin(a)", "0", "-1e-14"),
]


@dataclass
class Parts:
    """Rows {coordinate or `dt`: coefficient} over u1, u2, ..., values of the start, and what they take of freedom."""

    random: random.Random
    rows: list[dict[str, str]] = field(default_factory=list)
    start: dict[str, str] = field(default_factory=dict)
    integrals: int = 0

    def coordinate(self, value: str | None = None) -> str:
        """A new coordinate, with a decimal or a fraction as its value."""
        name = f"u{len(self.start) + 1}"
        of = self.random.randint
        self.start[name] = value or self.random.choice(
            [f"{of(-9, 9)}/7", f"{of(-20, 20)}/10", f"0.{of(1, 99)}"]
        )
        return name

    def integral(self) -> None:
        """du = 0."""
        self.rows.append({self.coordinate(): "1"})
        self.integrals += 1

    def contact(self, coefficient: str = "", holds: int = 0) -> None:
        """du - (v + 2) dw, or with a coefficient of other coordinates: then `holds` integrals come of it."""
        u, v, w = (self.coordinate() for _ in range(3))
        self.rows.append({u: "1", w: f"-({coefficient})*{v}" if coefficient else f"-({v} + 2)"})
        self.integrals += holds

    def nearly(self) -> None:
        """A contact form with a coefficient that nearly vanishes."""
        g, value = self.random.choice(list(NEARLY.items()))
        self.contact(_put(g, self.coordinate(value)))

    def kept(self, is_on: bool) -> None:
        """da = 0 and du - g(a) v dw: two integrals on g = 0, one beside it."""
        g, on, beside = self.random.choice(ZEROS)
        a = self.coordinate(on if is_on else beside)
        self.rows.append({a: "1"})
        self.integrals += 1
        self.contact(_put(g, a), int(is_on))

    def left(self) -> None:
        """du - g(a) v dw from g = 0, which the row leads away from."""
        g, on, _ = self.random.choice(ZEROS)
        self.contact(_put(g, self.coordinate(on)))

    def hidden(self) -> None:
        """da = 0 and da = k (b - g(c)) dt: b = g(c) is demanded."""
        gain = self.random.choice(["1", "10", "1e3", "1e6", "1e-6", "7/3"])
        a, c = self.coordinate(), self.coordinate(self.random.choice(["pi/3", "2/7", "0.3", "1/3"]))
        g = self.random.choice([f"2*cos({c})", f"{c}**2 + {c}", f"exp({c})", f"sin({c})"])
        b = self.coordinate(g.replace(c, f"({self.start[c]})"))
        self.rows += [{a: "1"}, {a: "1", "dt": f"-({gain})*({b} - {g})"}]
        self.integrals += 2


def _put(g: str, name: str) -> str:
    a = sympy.Symbol("a")
    return str(sympy.sympify(g, locals={"a": a}, rational=True).xreplace({a: sympy.Symbol(name)}))


def system(seed: int) -> tuple[str, int]:
    """The text of a model, and its degrees of freedom n - s."""
    generator = random.Random(seed)
    parts = Parts(generator)
    kinds = [
        parts.integral,
        parts.contact,
        parts.nearly,
        lambda: parts.kept(True),
        lambda: parts.kept(False),
        parts.left,
        parts.hidden,
    ]
    for kind in generator.sample(kinds, generator.randint(1, 2)):
        kind()
    while len(parts.start) < 3:
        parts.coordinate()
    return _written(parts, generator), len(parts.start) - parts.integrals


def _written(parts: Parts, generator: random.Random) -> str:
    """The model in coordinates x with u1 = x1, u2 = x2 + g(x1), ..., its rows mixed and multiplied."""
    us = [sympy.Symbol(name, real=True) for name in parts.start]
    xs = [sympy.Symbol(NAMES[k] if k < len(NAMES) else f"x{k}", real=True) for k in range(len(us))]
    shifts = [_shift(parts, generator, u.name, xs[:k]) for k, u in enumerate(us)]
    U = {u: x + shift for u, x, shift in zip(us, xs, shifts, strict=True)}
    rows = _mixed([_pulled_back(row, U, xs) for row in parts.rows], xs, generator)
    values: dict[sympy.Symbol, str] = {}
    for x, shift, text in zip(xs, shifts, parts.start.values(), strict=True):
        moved = shift.xreplace({other: sympy.Symbol(f"({value})") for other, value in values.items()})
        values[x] = f"{text} - ({moved})" if shift != 0 else text
    lines = ["lagcli: 1", "coordinates:"]
    lines += [f'  {x}: {{value: "{value}"}}' for x, value in values.items()]
    lines.append('lagrangian: "' + " + ".join(f"rate({x})**2/2" for x in xs) + '"')
    lines.append("differential:")
    for i, row in enumerate(rows):
        terms = [f"({a})*{'dt' if x == DT else f'd({x})'}" for x, a in row.items() if a != 0]
        lines.append(f'  n{i + 1}: "{" + ".join(terms)} = 0"')
    return "\n".join(lines) + "\n"


def _shift(parts: Parts, generator: random.Random, name: str, before: list[sympy.Symbol]) -> sympy.Expr:
    """What is added to a coordinate; those that coefficients hold stay, so that places are those that are written."""
    held = {str(x) for row in parts.rows for text in row.values() for x in sympy.sympify(text).free_symbols}
    if not before or name in held or generator.random() > 0.4:
        return sympy.Integer(0)
    other = generator.choice(before)
    return generator.choice([other, other**2, 2 * other, other * before[0]])


def _pulled_back(row: dict[str, str], U: dict[sympy.Symbol, sympy.Expr], xs: list[sympy.Symbol]) -> Form:
    """A row in the coordinates x."""
    by_name = {str(u): u for u in U}
    form: Form = dict.fromkeys([*xs, DT], sympy.Integer(0))
    for name, text in row.items():
        a = sympy.sympify(text, locals=by_name, rational=True).xreplace(U)
        if name == "dt":
            form[DT] += a
            continue
        for x in xs:
            form[x] += a * sympy.diff(U[by_name[name]], x)
    return form


def _mixed(rows: list[Form], xs: list[sympy.Symbol], generator: random.Random) -> list[Form]:
    """The rows with multiples of rows before them added, and multiplied by functions that vanish nowhere."""
    for i in range(len(rows)):
        for j in range(i):
            if generator.random() < 0.4:
                c = generator.choice([sympy.Integer(1), sympy.Integer(-2), xs[0] ** 2 + 1, xs[-1]])
                rows[i] = {x: a + c * rows[j][x] for x, a in rows[i].items()}
        if generator.random() < 0.5:
            gains = [xs[0] ** 2 + 2, sympy.exp(xs[-1]), sympy.Integer(1000), sympy.Rational(1, 1000)]
            c = generator.choice(gains)
            rows[i] = {x: c * a for x, a in rows[i].items()}
    return rows
