"""A second way from a model to its equations, which shares nothing with the package but the notation.

Formulas are evaluated by Python itself over jets (value, gradient, Hessian) in z = (t, q, v), plain numpy. From
them come M, h, B, b, gamma of (D.24) and so lambda and R at one state, to compare with what a run has written.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import re
from collections.abc import Callable, Iterator
from fractions import Fraction
from typing import Any

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


@dataclasses.dataclass
class Jet:
    """A number with its first and second derivatives by z; `size` of z is that of `g`."""

    value: float
    g: Floats
    H: Floats

    def _chain(self, f: float, df: float, ddf: float) -> Jet:
        return Jet(f, df * self.g, df * self.H + ddf * np.outer(self.g, self.g))

    def _lift(self, other: Any) -> Jet:
        return other if isinstance(other, Jet) else Jet(float(other), 0 * self.g, 0 * self.H)

    def __add__(self, other: Any) -> Any:
        if isinstance(other, Vec):
            return NotImplemented
        o = self._lift(other)
        return Jet(self.value + o.value, self.g + o.g, self.H + o.H)

    __radd__ = __add__

    def __neg__(self) -> Jet:
        return Jet(-self.value, -self.g, -self.H)

    def __sub__(self, other: Any) -> Any:
        return self + -other

    def __rsub__(self, other: Any) -> Any:
        return -self + other

    def __mul__(self, other: Any) -> Any:
        if isinstance(other, Vec):
            return NotImplemented
        o = self._lift(other)
        cross = np.outer(self.g, o.g)
        H = self.value * o.H + o.value * self.H + cross + cross.T
        return Jet(self.value * o.value, self.value * o.g + o.value * self.g, H)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Any:
        return self * power(other, -1)

    def __rtruediv__(self, other: Any) -> Any:
        return other * power(self, -1)

    def __pow__(self, other: Any) -> Any:
        return power(self, other)

    def __rpow__(self, other: float) -> Jet:
        f, log = other**self.value, math.log(other)
        return self._chain(f, f * log, f * log * log)


def power(base: Any, n: Any) -> Any:
    """base ** n for a number n."""
    if not isinstance(base, Jet):
        return float(base) ** n
    x = base.value
    return base._chain(
        x**n, n * x ** (n - 1) if n else 0.0, n * (n - 1) * x ** (n - 2) if n * (n - 1) else 0.0
    )


def _function(f: Callable[[float], tuple[float, float, float]]) -> Callable[[Any], Any]:
    return lambda u: u._chain(*f(u.value)) if isinstance(u, Jet) else f(float(u))[0]


def _sqrt(x: float) -> tuple[float, float, float]:
    s = math.sqrt(x)
    return (s, 0.5 / s, -0.25 / s**3) if s else (s, math.nan, math.nan)


class Vec:
    """Three components; `velocity` where it is a particle's position."""

    def __init__(self, parts: Any, velocity: Vec | None = None) -> None:
        self.parts = tuple(parts)
        self._velocity = velocity

    def __iter__(self) -> Iterator[Any]:
        return iter(self.parts)

    def __getattr__(self, name: str) -> Any:
        if name in ("x", "y", "z"):
            return self.parts["xyz".index(name)]
        if self._velocity is not None and name in ("v", "vx", "vy", "vz"):
            return self._velocity if name == "v" else self._velocity.parts["xyz".index(name[1])]
        raise AttributeError(name)

    def __add__(self, other: Vec) -> Vec:
        return Vec(a + b for a, b in zip(self, other, strict=True))

    def __sub__(self, other: Vec) -> Vec:
        return Vec(a - b for a, b in zip(self, other, strict=True))

    def __neg__(self) -> Vec:
        return Vec(-a for a in self)

    def __mul__(self, other: Any) -> Vec:
        return Vec(a * other for a in self)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Vec:
        return Vec(a / other for a in self)


def dot(u: Vec, w: Vec) -> Any:
    return u.x * w.x + u.y * w.y + u.z * w.z


def norm(u: Vec) -> Any:
    return FUNCTIONS["sqrt"](dot(u, u))


def cross(u: Vec, w: Vec) -> Vec:
    return Vec((u.y * w.z - u.z * w.y, u.z * w.x - u.x * w.z, u.x * w.y - u.y * w.x))


FUNCTIONS: dict[str, Any] = {
    "sin": _function(lambda x: (math.sin(x), math.cos(x), -math.sin(x))),
    "cos": _function(lambda x: (math.cos(x), -math.sin(x), -math.cos(x))),
    "exp": _function(lambda x: (math.exp(x),) * 3),
    "sqrt": _function(_sqrt),
    "tanh": _function(lambda x: (math.tanh(x), math.cosh(x) ** -2, -2 * math.tanh(x) * math.cosh(x) ** -2)),
    "atan": _function(lambda x: (math.atan(x), 1 / (1 + x * x), -2 * x / (1 + x * x) ** 2)),
    "log": _function(lambda x: (math.log(x), 1 / x, -1 / x**2)),
    "dot": dot,
    "norm": norm,
    "cross": cross,
    "distance": lambda u, w: norm(u - w),
    "vector": lambda *parts: Vec(parts),
    "pi": math.pi,
}


def evaluate(text: str, names: dict[str, Any]) -> Any:
    """The value of a formula: Python's own reading of it, with `[...]` for a vector."""
    return eval(text.strip().replace("[", "vector(").replace("]", ")"), {"__builtins__": {}}, names)


def numbers(value: Any) -> list[float]:
    """The number of a scalar, the three of a vector."""
    parts = list(value) if isinstance(value, Vec) else [value]
    return [part.value if isinstance(part, Jet) else float(part) for part in parts]


def difference(equation: str, names: dict[str, Any]) -> list[Any]:
    """left - right of an equation, one or three."""
    left, _, right = equation.partition("=")
    value = evaluate(left, names)
    if right.strip() not in ("", "0"):
        value = value - evaluate(right, names)
    return list(value) if isinstance(value, Vec) else [value]


def flat_name(name: str, numbers: dict[str, Any] | None = None) -> str:
    """The name a formula of this file has for a member of a family: `p[1][2].x` is `p_1_2.x`, `p[-1]` is `p_m1`.

    `numbers` are the values of index variables and parameters in the brackets.
    """

    def one(found: re.Match[str]) -> str:
        return f"_{whole(found.group(1), numbers or {})}".replace("-", "m")

    return re.sub(r"(?<=[\w\]])\[([^\[\]]*)\]", one, name)


def whole(text: str, numbers: dict[str, Any]) -> int:
    """The value of an integer expression, by fractions."""
    value = exact(text, numbers)
    assert value == int(value), text
    return int(value)


def exact(text: str, numbers: dict[str, Any]) -> Any:
    """The value of an integer expression or filter, by fractions."""
    names = {key: Fraction(value) for key, value in numbers.items()}
    known = {"Fraction": Fraction, "abs": abs, "min": min, "max": max, "__builtins__": {}}
    return eval(re.sub(r"(?<![\w.])\d+", r"Fraction(\g<0>)", text), known, names)


@dataclasses.dataclass
class Spec:
    """A model as its generator knows it; texts in the notation of the format. Vectors are one text."""

    parameters: dict[str, str] = dataclasses.field(default_factory=dict)
    coordinates: dict[str, list[float]] = dataclasses.field(default_factory=dict)
    masses: dict[str, str] = dataclasses.field(default_factory=dict)
    free: dict[str, list[list[float]]] = dataclasses.field(default_factory=dict)
    dependent: dict[str, str] = dataclasses.field(default_factory=dict)  # each after those it uses
    definitions: dict[str, str] = dataclasses.field(default_factory=dict)
    lagrangian: str = ""
    potentials: dict[str, str] = dataclasses.field(default_factory=dict)
    forces: dict[str, tuple[list[str], str]] = dataclasses.field(default_factory=dict)
    constant: set[str] = dataclasses.field(default_factory=set)  # forces that count as potentials
    generalized: dict[str, tuple[list[str], str]] = dataclasses.field(default_factory=dict)
    holonomic: dict[str, str] = dataclasses.field(default_factory=dict)
    rigid: dict[str, list[str]] = dataclasses.field(default_factory=dict)
    differential: dict[str, str] = dataclasses.field(default_factory=dict)
    outputs: dict[str, str] = dataclasses.field(default_factory=dict)

    @property
    def particles(self) -> list[str]:
        """In the order in which they are written: `masses` names them all."""
        return list(self.masses)

    def start(self) -> tuple[Floats, Floats]:
        """Initial q and v."""
        pairs = [pair for p in self.particles if p in self.free for pair in zip(*self.free[p], strict=True)]
        pairs += [tuple(pair) for pair in self.coordinates.values()]
        both = np.array(pairs, dtype=float).reshape(-1, 2)
        return both[:, 0].copy(), both[:, 1].copy()

    def set_start(self, q: Floats, v: Floats) -> None:
        """Put values in the places of the start."""
        free = [p for p in self.particles if p in self.free]
        for k, name in enumerate(free):
            self.free[name] = [q[3 * k : 3 * k + 3].tolist(), v[3 * k : 3 * k + 3].tolist()]
        for j, name in enumerate(self.coordinates, 3 * len(free)):
            self.coordinates[name] = [float(q[j]), float(v[j])]

    def text(self) -> str:
        """The model file."""
        lines = ["lagcli: 1"]

        def section(name: str, entries: dict[str, str]) -> None:
            if entries:
                lines.extend([f"{name}:", *(f"  {key}: {value}" for key, value in entries.items())])

        def quoted(entries: dict[str, str]) -> dict[str, str]:
            return {key: f'"{value}"' for key, value in entries.items()}

        section("parameters", quoted(self.parameters))
        section(
            "coordinates", {k: f"{{value: {q!r}, rate: {v!r}}}" for k, (q, v) in self.coordinates.items()}
        )
        particles = {}
        for name, mass in self.masses.items():
            if name in self.free:
                position, velocity = self.free[name]
                particles[name] = f'{{mass: "{mass}", position: {position}, velocity: {velocity}}}'
            else:
                particles[name] = f'{{mass: "{mass}", position: "{self.dependent[name]}"}}'
        section("particles", particles)
        section("definitions", quoted(self.definitions))
        if self.lagrangian:
            lines.append(f'lagrangian: "{self.lagrangian}"')
        forces = {k: f'{{potential: "{v}"}}' for k, v in self.potentials.items()}
        for key, (to, force) in (self.forces | self.generalized).items():
            forces[key] = f'{{to: [{", ".join(to)}], force: "{force}"}}'
        section("forces", forces)
        section("holonomic", quoted(self.holonomic))
        section("rigid", {k: f"[{', '.join(v)}]" for k, v in self.rigid.items()})
        section("differential", quoted(self.differential))
        section("outputs", quoted(self.outputs))
        return "\n".join(lines) + "\n"


@dataclasses.dataclass
class Equations:
    """M a = h + B^T lambda, B a = gamma, f = 0, B v + b = 0 at one state; what follows from them on request."""

    M: Floats
    h: Floats
    B: Floats
    b: Floats
    gamma: Floats
    f: Floats
    kinetic: float
    potential: float
    energy: float

    def solved(self) -> tuple[Floats, Floats]:
        """a and lambda."""
        C, n = self.B.shape
        whole = np.block([[self.M, -self.B.T], [self.B, np.zeros((C, C))]])
        result = np.linalg.solve(whole, np.concatenate([self.h, self.gamma]))
        return result[:n], result[n:]


# Edges of the base with their lengths; further particles with the base and their weights.
Body = tuple[list[tuple[str, str, float]], list[tuple[str, list[str], Floats]]]


class Oracle:
    """The equations of a `Spec`, state by state."""

    def __init__(self, spec: Spec) -> None:
        self.spec = spec
        self.n = spec.start()[0].size
        self._bodies: list[Body] = []
        q, v = spec.start()
        names = self.names(0.0, q, v)
        for body in spec.rigid.values():
            self._bodies.append(_body(body, {p: np.array([c.value for c in names[p]]) for p in body}))

    def names(self, t: float, q: Floats, v: Floats) -> dict[str, Any]:
        """What the names of the model stand for at a state, as jets in z = (t, q, v)."""
        n, spec = self.n, self.spec
        size = 1 + 2 * n
        z = [
            Jet(float(x), np.eye(size)[i], np.zeros((size, size)))
            for i, x in enumerate(np.concatenate([[t], q, v]))
        ]
        self._z = z
        names: dict[str, Any] = {**FUNCTIONS, "t": z[0], "dt": 1.0}
        names["rate"] = lambda u: u.v if isinstance(u, Vec) else self.rate(u)
        names["d"] = lambda u: Vec(self.rate(c) for c in u) if isinstance(u, Vec) else self.rate(u)
        for key, text in spec.parameters.items():
            names[key] = evaluate(text, names)
        free = [p for p in spec.particles if p in spec.free]
        for k, name in enumerate(free):
            at = 1 + 3 * k
            names[name] = Vec(z[at : at + 3], Vec(z[at + n : at + n + 3]))
        for j, name in enumerate(spec.coordinates, 1 + 3 * len(free)):
            names[name] = z[j]
        for name, text in spec.dependent.items():
            place = Vec(self._lifted(c) for c in evaluate(text, names))
            names[name] = Vec(place, Vec(self.rate(c) for c in place))
        for key, text in spec.definitions.items():
            names[key] = evaluate(text, names)
        return names

    def _lifted(self, value: Any) -> Jet:
        size = 1 + 2 * self.n
        return value if isinstance(value, Jet) else Jet(float(value), np.zeros(size), np.zeros((size, size)))

    def rate(self, value: Any) -> Jet:
        """d/dt of a function of (t, q): exact value, gradient and derivatives by v; no second ones by q."""
        u, n = self._lifted(value), self.n
        direction = np.zeros(1 + 2 * n)
        direction[0], v = 1.0, np.array([x.value for x in self._z[1 + n :]])
        direction[1 : 1 + n] = v
        g = u.H @ direction
        g[1 + n :] += u.g[1 : 1 + n]
        H = np.zeros_like(u.H)
        H[: 1 + n, 1 + n :] = u.H[: 1 + n, 1 : 1 + n]
        H[1 + n :, : 1 + n] = H[: 1 + n, 1 + n :].T
        return Jet(float(u.g @ direction), g, H)

    def constraints(self, t: float, q: Floats, v: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """B (C, n), b (C,), gamma (C,), f (s,)."""
        names = self.names(t, q, v)
        whole = [part for text in self.spec.holonomic.values() for part in difference(text, names)]
        for edges, further in self._bodies:
            whole += [norm(names[i] - names[j]) - length for i, j, length in edges]
            for name, base, alpha in further:
                place = sum((names[b] * w for b, w in zip(base, alpha, strict=True)), Vec((0.0,) * 3))
                whole += list(names[name] - place)
        whole = [self._lifted(u) for u in whole]
        laws = [self.rate(u) for u in whole]
        laws += [
            self._lifted(part) for text in self.spec.differential.values() for part in difference(text, names)
        ]
        n = self.n
        g = np.array([w.g for w in laws]).reshape(len(laws), 1 + 2 * n)
        B = g[:, 1 + n :]
        b = np.array([w.value for w in laws]) - B @ v
        gamma = -(g[:, 0] + g[:, 1 : 1 + n] @ v)
        return B, b, gamma, np.array([u.value for u in whole])

    def equations(self, t: float, q: Floats, v: Floats) -> Equations:
        """All of (D.24) at a state."""
        spec, n = self.spec, self.n
        names = self.names(t, q, v)
        kinetic, h, M = 0.0, np.zeros(n), np.zeros((n, n))
        V = self._lifted(0.0)
        for p, mass in self.masses(names).items():
            kinetic += mass / 2 * sum(self._lifted(c).value ** 2 for c in names[p].v)
            J = np.array([c.g[1 : 1 + n] for c in names[p]])
            M += mass * J.T @ J
            h -= mass * J.T @ np.array([self._turning(c) for c in names[p]])
            h += J.T @ self._declared(p, names)
        for name, (targets, text) in spec.forces.items():
            if name in spec.constant:
                for p in targets:
                    V = V - dot(evaluate(text, self._own(p, names)), names[p])
        h += V.g[1 : 1 + n]  # constant forces are in already
        for text in spec.potentials.values():
            V = V + evaluate(text, names)
        for targets, text in spec.generalized.values():
            for name in targets:
                h[names[name].g[1 : 1 + n].argmax()] += self._lifted(evaluate(text, names)).value
        extra = self._lifted(evaluate(spec.lagrangian, names) if spec.lagrangian else 0.0)
        mixed = extra.H[1 + n :]
        M = M + mixed[:, 1 + n :]
        h = h - V.g[1 : 1 + n] + extra.g[1 : 1 + n] - mixed[:, 1 : 1 + n] @ v - mixed[:, 0]
        energy = kinetic + V.value + float(extra.g[1 + n :] @ v) - extra.value
        return Equations(M, h, *self.constraints(t, q, v), kinetic, V.value, energy)

    def masses(self, names: dict[str, Any]) -> dict[str, float]:
        """Numbers of the masses."""
        return {p: float(evaluate(mass, names)) for p, mass in self.spec.masses.items()}

    def _own(self, p: str, names: dict[str, Any]) -> dict[str, Any]:
        return names | {"m": self.masses(names)[p], "r": names[p], "v": names[p].v}

    def _declared(self, p: str, names: dict[str, Any]) -> Floats:
        """The sum of the forces declared on a particle (potentials not)."""
        texts = [text for targets, text in self.spec.forces.values() if p in targets]
        parts = [[self._lifted(c).value for c in evaluate(text, self._own(p, names))] for text in texts]
        return np.array(parts).reshape(-1, 3).sum(axis=0)

    def reaction(self, p: str, t: float, q: Floats, v: Floats, a: Floats) -> Floats:
        """R = m a - F of a dependent particle, F with the gradient of the potentials as if it were free."""
        names = self.names(t, q, v)
        J = np.array([c.g[1 : 1 + self.n] for c in names[p]])
        turning = np.array([self._turning(c) for c in names[p]])
        where = [c.value for c in names[p]]
        zero = np.zeros((3, 3))
        free: dict[str, Any] = {key: _fixed(value) for key, value in names.items()}
        free[p] = Vec(Jet(x, e, zero) for x, e in zip(where, np.eye(3), strict=True))
        for key, text in self.spec.definitions.items():
            free[key] = evaluate(text, free)
        gradient = np.zeros(3)
        for text in self.spec.potentials.values():
            value = evaluate(text, free)
            gradient += value.g if isinstance(value, Jet) else 0.0
        applied = self._declared(p, names) - gradient
        return np.asarray(self.masses(names)[p] * (J @ a + turning) - applied)

    def _turning(self, place: Jet) -> float:
        """The acceleration of x(q, t) at constant rates."""
        direction = np.concatenate([[1.0], [x.value for x in self._z[1 + self.n :]], np.zeros(self.n)])
        return float(direction @ place.H @ direction)


def _fixed(value: Any) -> Any:
    """A value that nothing is differentiated by."""
    if isinstance(value, Jet):
        return value.value
    return Vec(map(_fixed, value)) if isinstance(value, Vec) else value


def _body(particles: list[str], points: dict[str, Floats]) -> Body:
    """Edges of the base, and the further particles with their weights, as the format describes rigid bodies."""
    base, directions = [particles[0]], np.zeros((0, 3))
    for p in particles[1:]:
        rest = points[p] - points[base[0]]
        rest = rest - directions.T @ (directions @ rest)
        if np.linalg.norm(rest) > 1e-7 and len(base) < 4:
            base.append(p)
            directions = np.vstack([directions, rest / np.linalg.norm(rest)])
    pairs = sorted(itertools.combinations(range(len(base)), 2), key=lambda pair: (pair[1], pair[0]))
    edges = [(base[i], base[j], float(np.linalg.norm(points[base[i]] - points[base[j]]))) for i, j in pairs]
    further = []
    for p in particles:
        if p not in base:
            sides = np.array([points[k] - points[base[0]] for k in base[1:]]).T
            weights = np.linalg.lstsq(sides, points[p] - points[base[0]], rcond=None)[0]
            further.append((p, base, np.array([1 - weights.sum(), *weights])))
    return edges, further
