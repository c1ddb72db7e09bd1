"""Strategies for whole models that are valid by construction: the start satisfies all that is declared."""

from __future__ import annotations

import dataclasses
import functools
import json
import re
from collections.abc import Callable

import numpy as np
from hypothesis import strategies as st

from tests.helpers import jets

PARTICLES, COORDINATES = ("a", "b", "c", "e"), ("q", "u", "w", "theta")
PARAMETERS = {"k": "2.5", "L": "1.5", "g": "9.81", "s": "k/5", "n3": "[0.5, -1, 2]", "two": "2"}

places = st.integers(-6, 6).map(lambda i: i / 2)
speeds = st.integers(-4, 4).map(lambda i: i / 4)
factors = st.sampled_from(("2", "0.5", "k", "s", "-1.25", "L", "3", "1e-1"))


@st.composite
def formulas(draw: st.DrawFn, leaves: list[str], depth: int = 2) -> str:
    """A smooth scalar of the leaves, defined everywhere."""
    kind = draw(
        st.sampled_from(("leaf", "leaf", "sum", "difference", "product", "scaled", "function", "power"))
    )
    if kind == "leaf" or depth == 0:
        return draw(st.sampled_from(leaves))
    inner = draw(formulas(leaves, depth - 1))
    match kind:
        case "sum":
            return f"({inner} + {draw(formulas(leaves, depth - 1))})"
        case "difference":
            return f"({inner} - {draw(formulas(leaves, depth - 1))})"
        case "product":
            return f"{inner}*{draw(formulas(leaves, depth - 1))}"
        case "scaled":
            return f"{draw(factors)}*{inner}" if draw(st.booleans()) else f"{inner}/{draw(factors)}"
        case "power":
            return f"({inner})**{draw(st.sampled_from(('2', '3', 'two', '2.0')))}"
        case _:
            pattern = ("sin({})", "cos({})", "tanh({})", "atan({})", "exp(-({})**2)", "sqrt(1 + ({})**2)")
            return draw(st.sampled_from((*pattern, "1/(1 + ({})**2)", "log(2 + ({})**2)"))).format(inner)


def components(name: str) -> list[str]:
    return [f"{name}.{axis}" for axis in "xyz"]


@st.composite
def systems(draw: st.DrawFn) -> jets.Spec:
    """A model with Cartesian particles, generalized coordinates with dependent particles, or both."""
    spec = jets.Spec(parameters=dict(PARAMETERS))
    kind = draw(st.sampled_from(("particles", "particles", "coordinates", "both")))
    free = PARTICLES[: draw(st.integers(1, 4 if kind == "particles" else 2))] if kind != "coordinates" else ()
    spots = draw(st.lists(st.tuples(*[places] * 3), min_size=len(free), max_size=len(free), unique=True))
    for name, spot in zip(free, spots, strict=True):
        spec.masses[name] = draw(st.sampled_from(("1", "2", "k", "0.25", "k/L")))
        spec.free[name] = [list(spot), [draw(speeds) for _ in "xyz"]]
    if kind != "particles":
        count = draw(st.integers(1, 4 if kind == "coordinates" else 2))
        for name in COORDINATES[:count]:
            spec.coordinates[name] = [draw(places), draw(speeds)]
        _carry(draw, spec)
    wholes = _wholes(spec)
    if draw(st.booleans()):
        spec.definitions["half"] = f"{draw(formulas(wholes))}/2"
        wholes.append("half")
    _forces(draw, spec, wholes)
    _constraints(draw, spec, wholes)
    _outputs(draw, spec, wholes)
    return _consistent(draw, spec)


def _wholes(spec: jets.Spec) -> list[str]:
    """Names of what depends on positions and coordinates."""
    dependent = [part for name in spec.dependent for part in components(name)]
    return [*(part for name in spec.free for part in components(name)), *spec.coordinates, *dependent]


def _carry(draw: st.DrawFn, spec: jets.Spec) -> None:
    """Inertia for the coordinates: a lagrangian, dependent particles, or both."""
    names = list(spec.coordinates)
    if draw(st.booleans()):
        place = st.sampled_from(("L*sin({})", "-L*cos({})", "{}", "0", "2*{}", "{} + s*sin(k*t)", "{}**2/4"))
        for name in ("ball", "bob")[: draw(st.integers(1, 2))]:
            spec.masses[name] = draw(factors.filter(lambda text: text[0] != "-"))
            parts = [draw(place).format(draw(st.sampled_from(names))) for _ in "xyz"]
            base = "ball + " if name == "bob" and draw(st.booleans()) else ""
            spec.dependent[name] = f"{base}[{', '.join(parts)}]"
    terms = [f"{draw(st.sampled_from(('k', '1', '0.5', 'L')))}*rate({name})**2/2" for name in names]
    if len(names) > 1 and draw(st.booleans()):
        terms.append(f"0.2*cos({names[0]} - {names[1]})*rate({names[0]})*rate({names[1]})")
    if draw(st.booleans()):
        terms.append(f"(1 + {names[-1]}**2)*rate({names[0]})**2/2")
    if draw(st.booleans()):
        terms.append(f"rate({names[0]})*sin({names[-1]} + t)")
    if draw(st.booleans()):
        terms.append("-" + draw(formulas(names)))
    spec.lagrangian = " + ".join(terms)


def _forces(draw: st.DrawFn, spec: jets.Spec, wholes: list[str]) -> None:
    names = spec.particles
    if names and draw(st.booleans()):
        spec.forces["weight"] = (names, "[0, 0, -m*g]")
        spec.constant.add("weight")
    if names and draw(st.booleans()):
        spec.forces["push"] = ([draw(st.sampled_from(names))], draw(st.sampled_from(("n3", "-2*n3/k"))))
        spec.constant.add("push")
    if names and draw(st.booleans()):
        force = draw(
            st.sampled_from(
                (
                    "-s*v",
                    "cross(n3, v)",
                    "-k*r",
                    "-0.1*norm(v)*v",
                    "[sin(t), v.x, -r.z]",
                    "-k*(r - n3)*cos(t)",
                )
            )
        )
        spec.forces["pull"] = (draw(st.lists(st.sampled_from(names), min_size=1, unique=True)), force)
    if len(names) > 1 and draw(st.booleans()):
        i, j = draw(st.permutations(names))[:2]
        # Dependent particles may stand at one place, where a distance has no gradient.
        far = i in spec.free or j in spec.free
        spec.potentials["spring"] = (
            f"k/2*(distance({i}, {j}) - L)**2" if far else f"k/2*dot({i} - {j}, {i} - {j})"
        )
    if draw(st.booleans()):
        spec.potentials["field"] = f"{draw(formulas(wholes))} + 0.1*sin(t)*{draw(st.sampled_from(wholes))}"
    if spec.coordinates and draw(st.booleans()):
        targets = draw(st.lists(st.sampled_from(list(spec.coordinates)), min_size=1, unique=True))
        spec.generalized["motor"] = (
            targets,
            draw(st.sampled_from((f"-s*rate({targets[0]})", "sin(2*t)", "L"))),
        )


def _constraints(draw: st.DrawFn, spec: jets.Spec, wholes: list[str]) -> None:
    n = 3 * len(spec.free) + len(spec.coordinates)
    names = spec.particles
    if len(spec.free) > 1 and draw(st.integers(0, 3)) == 0:
        spec.rigid["body"] = list(spec.free)[: draw(st.integers(2, len(spec.free)))]
        n -= (1, 3, 6)[len(spec.rigid["body"]) - 2]
    for i in range(draw(st.integers(0, min(3, max(0, n - 1))))):
        choices = ["{f}", "{f} + sin(t)/2", "{x} - {f2}", "{x}**2 + {f2}**2"]
        if names:
            choices += ["norm({a})", "{a}.z - s*{a}.x", "dot({a}, {a})", "dot({a}, n3)", "{a}.x - t*L"]
        if len(names) > 1:
            choices += ["distance({a}, {b})", "dot({a} - {b}, {a} - {b})/2"]
        if len(spec.free) > 1 and n > 5 and i == 0:
            choices.append("{a} - {b}")
        a, b = draw(st.permutations(names))[:2] if len(names) > 1 else (names * 2)[:2] or ("", "")
        words = {"a": a, "b": b, "x": draw(st.sampled_from(wholes))}
        words |= {key: draw(formulas(wholes)) for key in ("f", "f2")}
        spec.holonomic[f"h{i}"] = draw(st.sampled_from(choices)).format(**words)
    if n > len(spec.holonomic) and draw(st.integers(0, 2)) == 0:
        free = [name for name in wholes if name in spec.coordinates or name.partition(".")[0] in spec.free]
        for i in range(draw(st.integers(1, 2))):
            x, y = draw(st.sampled_from(free)), draw(st.sampled_from(free))
            c, c2 = draw(formulas(wholes, 1)), draw(formulas(wholes, 1))
            pattern = ("{c}*d({x}) - ({c2})*d({y})", "d({x}) + {c}*dt", "d({c}) + d({y})",
                       "rate({x}) - ({c})*rate({y})", "sin({y})*rate({x}) + {c} + 1",
                       "d({x}) - {y}*d({c}) + 2*dt")  # fmt: skip
            spec.differential[f"w{i}"] = draw(st.sampled_from(pattern)).format(c=c, c2=c2, x=x, y=y)


def _outputs(draw: st.DrawFn, spec: jets.Spec, wholes: list[str]) -> None:
    if draw(st.booleans()):
        spec.outputs["o1"] = draw(formulas([*wholes, "t"], 3))
    if draw(st.booleans()):
        rates = [
            f"rate({x})" for x in wholes if x in spec.coordinates or x.partition(".")[0] in spec.particles
        ]
        rates += [f"{p}.v{axis}" for p in spec.particles for axis in "xyz"]
        spec.outputs["o2"] = draw(formulas([*wholes, *rates], 2))
    if spec.particles and draw(st.booleans()):
        p = draw(st.sampled_from(spec.particles))
        spec.outputs["o3"] = f"cross({p}, {p}.v) + L*n3"


def _consistent(draw: st.DrawFn, spec: jets.Spec) -> jets.Spec:
    """The constants of the constraints and the velocities that satisfy them at t = 0."""
    q, v = spec.start()
    oracle = jets.Oracle(spec)
    names = oracle.names(0.0, q, v)
    for name, text in spec.holonomic.items():
        parts = [part.value for part in jets.difference(text, names)]
        right = _constant(parts)
        spec.holonomic[name] = f"{right} = {text}" if draw(st.booleans()) else f"{text} = {right}"
    _settle(spec, oracle, keep_all=draw(st.integers(0, 9)) == 0)
    return spec


def _constant(parts: list[float]) -> str:
    return f"[{', '.join(map(repr, parts))}]" if len(parts) == 3 else repr(parts[0])


def _settle(spec: jets.Spec, oracle: jets.Oracle, keep_all: bool) -> None:
    """Leave laws out, unless all are kept, until they are independent; project the velocities onto them."""
    q, v = spec.start()
    while spec.holonomic or spec.differential:
        B = oracle.constraints(0.0, q, v)[0]
        if _independent(B) or (keep_all and np.isfinite(B).all()):
            break
        laws = spec.differential or spec.holonomic
        last = next(reversed(laws)).partition("_")[0]
        for name in [name for name in laws if name.partition("_")[0] == last]:
            del laws[name]
    B, b, _, _ = oracle.constraints(0.0, q, v)
    if len(b):
        v = v - np.linalg.lstsq(B, B @ v + b, rcond=1e-10)[0]
        v[np.abs(v) < 1e-12] = 0.0
    spec.set_start(q, v)


def _independent(B: jets.Floats) -> bool:
    lengths = np.linalg.norm(B, axis=1)
    if not B.size or not lengths.min() >= 1e-3:
        return not B.shape[0]
    sigma = np.linalg.svd(B / lengths[:, None], compute_uv=False)
    return len(sigma) == len(B) and bool(sigma.min() > 1e-2)


# Families: the same model twice, as its file writes it and member by member under flat names.

Numbers = dict[str, int]


@dataclasses.dataclass(frozen=True)
class Loop:
    """`for` and `if`, and how the name shows the indices; pairs of members for laws between two of them."""

    ranges: tuple[str, ...]
    condition: str = ""
    key: str = "[i]"
    pairs: tuple[tuple[Loop, str, str], ...] = ()

    def members(self, numbers: Numbers) -> list[Numbers]:
        """The values of the index variables at each member, by plain loops."""
        found: list[Numbers] = [{}]
        for text in self.ranges:
            name, _, bounds = text.partition(" = ")
            low, high = bounds.split("..")
            found = [
                {**m, name: k}
                for m in found
                for k in range(jets.whole(low, numbers | m), jets.whole(high, numbers | m) + 1)
            ]
        return [m for m in found if not self.condition or jets.exact(self.condition, numbers | m)]


ALONE = Loop((), key="")
LOOPS = (
    Loop(("i = 1..N",), pairs=(
        (Loop(("i = 2..N",)), "[i-1]", "[i]"),
        (Loop(("i = 1..N", "j = i+1..N"), key="[i][j]"), "[i]", "[j]"),
        (Loop(("j = 1..N - 1",), "j != 2", "[j + 7]"), "[j]", "[j+1]"),
        (Loop(("i = N..1",)), "[i-9]", "[i]"),
    )),
    Loop(("i = 0..N - 1",), pairs=((Loop(("i = 1..N*2/2 - 1",)), "[i - 1]", "[i]"),)),
    Loop(("i = 1..N",), key="[2*i - 1]", pairs=((Loop(("i = 2..N",)), "[2*i-3]", "[2*i-1]"),)),
    Loop(("i = 1..2*N",), "i/2 <= 1 or i == 2*N", pairs=((Loop(("i = 1..two",)), "[i]", "[2*N]"),)),
    Loop(("i = 1..2", "j = 1..two"), key="[i][j]", pairs=(
        (Loop(("j = 1..two",), key="[j]"), "[1][j]", "[2][j]"),
        (Loop(("i = 1..2", "j = 1..2", "k1 = i..2"), "i < k1 and not j == 2", "[i][j][k1]"), "[i][j]", "[k1][j+1]"),
    )),
    Loop(("i = 1..3", "j = i + 1..3"), key="[i][j]", pairs=((Loop(("i = 2..2",)), "[1][i]", "[i][i+1]"),)),
    Loop(("i = -1..1",), "i != 0", pairs=((Loop(("i = 1..1",)), "[-i]", "[i]"),)),
)  # fmt: skip


@dataclasses.dataclass
class Entry:
    """An entry as the file writes it; `@` in a field stands for numbers of each member, found when it is written."""

    section: str
    base: str
    loop: Loop
    fields: dict[str, str]
    members: list[Numbers]

    def names(self, numbers: Numbers) -> list[str]:
        """The members as a formula names them: `p[1][2]`."""

        def number(found: re.Match[str], member: Numbers) -> str:
            return f"[{jets.whole(found.group(1), numbers | member)}]"

        return [
            self.base + re.sub(r"\[([^\]]*)\]", functools.partial(number, member=m), self.loop.key)
            for m in self.members
        ]

    def chosen(self, values: list[list[float]]) -> str:
        """An expression of the indices that has at each member the number, or vector, given for it."""
        texts = [_constant(value) for value in values]
        if len(set(texts)) == 1:
            return texts[0]
        terms = []
        for member, text in zip(self.members, texts, strict=True):
            off = " - ".join(f"abs({name} - ({k}))" for name, k in member.items())
            terms.append(f"max(0, 1 - {off})*{text}")
        return " + ".join(terms) or "0"

    def written(self, values: Callable[[str, str], list[float]], numbers: Numbers) -> str:
        """The entry as YAML; `values` gives the numbers of a field of a member."""
        fields = {}
        if self.loop.ranges:
            fields["for"] = f"[{', '.join(map(_quoted, self.loop.ranges))}]"
        if len(self.loop.ranges) == 1:
            fields["for"] = _quoted(self.loop.ranges[0])
        if self.loop.condition:
            fields["if"] = _quoted(self.loop.condition)
        for key, text in self.fields.items():
            if "@" in text:
                text = text.replace("@", self.chosen([values(key, name) for name in self.names(numbers)]))
            fields[key] = text if key == "to" else _quoted(text)
        return f"{{{', '.join(f'{key}: {text}' for key, text in fields.items())}}}"


def _quoted(text: str) -> str:
    return f'"{text}"'


@dataclasses.dataclass
class Families(jets.Spec):
    """A spec that holds the members one by one under flat names, with the entries its file has instead."""

    numbers: Numbers = dataclasses.field(default_factory=dict)
    entries: list[Entry] = dataclasses.field(default_factory=list)
    whole_lines: dict[str, str] = dataclasses.field(default_factory=dict)  # by section: what is no family
    rights: dict[str, list[float]] = dataclasses.field(default_factory=dict)

    def flat(self, text: str, member: Numbers) -> str:
        """A formula of a family for one of its members."""
        text = jets.flat_name(text, self.numbers | member)
        for name, value in member.items():
            text = re.sub(rf"\b{name}\b", f"({value})", text)
        return text

    def entry(self, section: str, base: str, loop: Loop, **fields: str) -> list[tuple[str, Numbers]]:
        """A new entry; its members under their flat names."""
        made = Entry(section, base, loop, fields, loop.members(self.numbers))
        self.entries.append(made)
        return list(zip(map(jets.flat_name, made.names(self.numbers)), made.members, strict=True))

    def text(self) -> str:
        """The model file."""
        lines = [
            "lagcli: 1",
            "parameters:",
            *(f"  {key}: {_quoted(text)}" for key, text in self.parameters.items()),
        ]
        for section in ("coordinates", "particles", "definitions", "lagrangian", "forces", "holonomic", "rigid",
                        "differential", "outputs"):  # fmt: skip
            found = [
                entry for entry in self.entries if entry.section == section and not self._is_left_out(entry)
            ]
            if found:
                lines.append(f"{section}:")
            lines += [f"  {e.base}{e.loop.key}: {e.written(self._number_of, self.numbers)}" for e in found]
            if section in self.whole_lines:
                lines.append(f"{section}: {self.whole_lines[section]}")
        return "\n".join(lines) + "\n"

    def _is_left_out(self, entry: Entry) -> bool:
        laws = {"holonomic": self.holonomic, "differential": self.differential}.get(entry.section)
        return laws is not None and any(jets.flat_name(n) not in laws for n in entry.names(self.numbers))

    def _number_of(self, field: str, name: str) -> list[float]:
        name = jets.flat_name(name)
        if field == "equation":
            return self.rights[name]
        return self.free[name][1] if field == "velocity" else [self.coordinates[name][field == "rate"]]


@dataclasses.dataclass
class Cast:
    """What the formulas of a model of families may speak of, as texts in the notation of the format."""

    singles: list[tuple[Loop, str]] = dataclasses.field(default_factory=list)  # a particle of each member
    pairs: list[tuple[Loop, str, str]] = dataclasses.field(default_factory=list)
    rates: list[tuple[Loop, str]] = dataclasses.field(default_factory=list)  # a coordinate of each member
    particles: list[str] = dataclasses.field(default_factory=list)
    free: list[str] = dataclasses.field(default_factory=list)
    coordinates: list[str] = dataclasses.field(default_factory=list)

    @property
    def wholes(self) -> list[str]:
        """Scalars of single members."""
        return [part for name in self.particles for part in components(name)] + self.coordinates


@st.composite
def families(draw: st.DrawFn) -> jets.Spec:
    """A model with families of particles, of coordinates with dependent particles, or both."""
    numbers = {"N": draw(st.sampled_from((2, 3))), "two": 2}
    spec = Families(parameters={**PARAMETERS, "N": str(numbers["N"])}, numbers=numbers)
    kind = draw(st.sampled_from(("particles", "particles", "coordinates", "both")))
    cast = Cast()
    if kind != "particles":
        _coordinate_family(draw, spec, cast)
    if kind != "coordinates":
        _free_family(draw, spec, cast)
    if draw(st.booleans()):
        text = f"{draw(formulas(cast.wholes))}/2"
        spec.whole_lines["definitions"] = f"{{half: {_quoted(text)}}}"
        spec.definitions["half"] = spec.flat(text, {})
    _family_forces(draw, spec, cast)
    _family_laws(draw, spec, cast)
    _family_outputs(draw, spec, cast)
    q, v = spec.start()
    oracle = jets.Oracle(spec)
    names = oracle.names(0.0, q, v)
    for name, text in spec.holonomic.items():
        spec.rights[name] = [part.value for part in jets.difference(text, names)]
        spec.holonomic[name] = f"{text} = {_constant(spec.rights[name])}"
    _settle(spec, oracle, keep_all=draw(st.integers(0, 9)) == 0)
    return spec


def _free_family(draw: st.DrawFn, spec: Families, cast: Cast) -> None:
    known = {**jets.FUNCTIONS}
    for key, text in spec.parameters.items():
        known[key] = jets.evaluate(text, known)
    loop = draw(st.sampled_from(LOOPS))
    second = "j" if len(loop.ranges) > 1 else "i"
    f, g = (draw(formulas(["i", second, "k"])) for _ in "fg")
    place = draw(st.sampled_from(("[i*L, {j}, {f}]", "[{f}, {j}*2, i]", "n3 + [i, 0, 0] + {j}*[0, {g}, 1]")))
    made = [("p", loop, place.format(j=second, f=f, g=g))]
    if draw(st.booleans()):
        made.append(("p", Loop((), key="[12]" * (second == "i") or "[12][0]"), "[-2, 0.5, L]"))
    if draw(st.booleans()):
        made.append(("a", ALONE, "[0, -2.5, 1]"))
    draw(st.randoms(use_true_random=False)).shuffle(made)
    for base, one, position in made:
        mass = draw(st.sampled_from(("1", "k", "k/L", "k + i**2" if one.ranges else "two")))
        for name, member in spec.entry("particles", base, one, mass=mass, position=position, velocity="@"):
            spec.masses[name] = spec.flat(mass, member)
            spot = [float(part) for part in jets.evaluate(spec.flat(position, member), known)]
            spec.free[name] = [spot, [draw(speeds) for _ in "xyz"]]
        names = spec.entries[-1].names(spec.numbers)
        cast.free += names
        cast.particles += names
    cast.singles.append((loop, f"p{loop.key}"))
    cast.pairs += [(pair, f"p{one}", f"p{other}") for pair, one, other in loop.pairs]
    if len(made) > 1:
        cast.pairs.append(
            (loop, f"p{loop.key}", next(n for n in cast.free if n in ("a", "p[12]", "p[12][0]")))
        )


def _coordinate_family(draw: st.DrawFn, spec: Families, cast: Cast) -> None:
    loop = draw(
        st.sampled_from((Loop(("i = 1..two",)), Loop(("i = 1..N",)), Loop(("i = 1..4",), "i != 3 and i < 4")))
    )
    for name, _ in spec.entry("coordinates", "u", loop, value="@", rate="@"):
        spec.coordinates[name] = [draw(places), draw(speeds)]
    cast.coordinates = names = spec.entries[-1].names(spec.numbers)
    cast.rates.append((loop, "u[i]"))
    terms = [f"{draw(st.sampled_from(('k', '1', '0.5', 'L')))}*rate({name})**2/2" for name in names]
    if draw(st.booleans()):
        terms.append(f"0.2*cos({names[0]} - {names[1]})*rate({names[0]})*rate({names[1]})")
    if draw(st.booleans()):
        terms.append("-" + draw(formulas(names)))
    text = " + ".join(terms)
    spec.whole_lines["lagrangian"] = _quoted(text)
    spec.lagrangian = spec.flat(text, {})
    if draw(st.booleans()):
        return
    arm = draw(st.sampled_from(("[L*sin(u[i]), i, -L*cos(u[i])]", "[i*u[i], s*sin(k*t), i + u[1]**2/4]")))
    first = Loop((), key="[1]"), re.sub(r"\bi\b", "1", arm)
    rest = Loop(("i = 2..2",)), f"d[i-1] + {arm}"
    for one, position in draw(st.sampled_from(((first, rest), (rest, first), ((loop, arm),)))):
        for name, member in spec.entry("particles", "d", one, mass="k", position=position):
            spec.masses[name] = "k"
            spec.dependent[name] = spec.flat(position, member)
        cast.particles += spec.entries[-1].names(spec.numbers)
    # The equations evaluate in order; the file need not be in it.
    spec.dependent = dict(sorted(spec.dependent.items()))
    cast.singles.append((Loop(("j = 1..two",), key="[j]"), "d[j]"))
    cast.pairs.append((Loop(("i = 2..2",)), "d[i - 1]", "d[i]"))


def _family_forces(draw: st.DrawFn, spec: Families, cast: Cast) -> None:
    if cast.particles and draw(st.booleans()):
        bases = list(dict.fromkeys(name.partition("[")[0] for name in cast.particles))
        to = draw(st.sampled_from(("all", json.dumps(bases))))
        spec.entry("forces", "weight", ALONE, to=to, force="[0, 0, -m*g]")
        spec.forces["weight"] = ([jets.flat_name(name) for name in cast.particles], "[0, 0, -m*g]")
        spec.constant.add("weight")
    for loop, one in cast.singles:
        i = _index_of(loop)
        if draw(st.booleans()):
            _push(draw, spec, loop, one, cast.particles[-1])
        if draw(st.integers(0, 2)) == 0:
            _potential(spec, loop, draw(formulas([*components(one), i])))
    for loop, one, other in cast.pairs[:2]:
        if draw(st.booleans()):
            patterns = ("k/2*(distance({a}, {b}) - L)**2", "-k*{i}/(1 + dot({a} - {b}, {a} - {b}))")
            text = draw(st.sampled_from(patterns)).format(a=one, b=other, i=_index_of(loop))
            _potential(spec, loop, text)
    for loop, one in cast.rates:
        if draw(st.booleans()):
            force = draw(st.sampled_from((f"-s*rate({one})*i", "sin(2*t)/i", "L")))
            for name, member in spec.entry("forces", "motor", loop, to=_quoted(one), force=force):
                spec.generalized[name] = ([spec.flat(one, member)], spec.flat(force, member))


def _push(draw: st.DrawFn, spec: Families, loop: Loop, one: str, other: str) -> None:
    """A force on each member, perhaps on another particle too."""
    i = _index_of(loop)
    patterns = (
        "-s*v",
        f"-k*{i}*r",
        f"[sin(t)*{i}, v.x, -r.z]",
        f"cross(n3, v)/(1 + {i}**2)",
        f"[0, {i}, -m]",
    )
    force = draw(st.sampled_from(patterns))
    targets = [one, other] if draw(st.booleans()) else [one]
    to = json.dumps(targets) if draw(st.booleans()) or len(targets) > 1 else _quoted(one)
    for name, member in spec.entry("forces", f"f{len(spec.entries)}", loop, to=to, force=force):
        # A target named twice is acted on once.
        flat = list(dict.fromkeys(spec.flat(target, member) for target in targets))
        spec.forces[name] = (flat, spec.flat(force, member))
        if force == patterns[-1]:
            spec.constant.add(name)


def _potential(spec: Families, loop: Loop, text: str) -> None:
    for name, member in spec.entry("forces", f"v{len(spec.entries)}", loop, potential=text):
        spec.potentials[name] = spec.flat(text, member)


def _index_of(loop: Loop) -> str:
    """One of the index variables."""
    return loop.ranges[-1].partition(" ")[0]


def _family_laws(draw: st.DrawFn, spec: Families, cast: Cast) -> None:
    free = cast.free[: draw(st.integers(2, max(2, len(cast.free))))]
    points = np.array([spec.free[jets.flat_name(name)][0] for name in free])
    if len(free) > 1 and draw(st.integers(0, 4)) == 0 and _is_clear(points):
        bare = len(free) == len(cast.free) and {name[0] for name in free} == {"p"}
        spec.whole_lines["rigid"] = f"{{body: {'p' if bare and draw(st.booleans()) else json.dumps(free)}}}"
        spec.rigid["body"] = [jets.flat_name(name) for name in free]
    laws = draw(st.permutations(_equations(draw, cast)))[: draw(st.integers(0, 2))]
    for k, (loop, text) in enumerate(laws):
        for name, member in spec.entry("holonomic", f"h{k}", loop, equation=f"{text} = @"):
            spec.holonomic[name] = spec.flat(text, member)
    if draw(st.integers(0, 2)) == 0:
        loop, one = draw(st.sampled_from(cast.singles + cast.rates))
        x, y = (f"{one}.x", f"{one}.y") if one[0] in "pd" else (one, draw(st.sampled_from(cast.coordinates)))
        c = draw(formulas([*cast.wholes[:3], x, _index_of(loop)], 1))
        patterns = ("d({x}) - {c}*d({y})", "rate({x}) - ({c})*rate({y}) + {i}", "d({c}*{y}) + {i}*d({x})")
        law = draw(st.sampled_from((*patterns, "d({x}) + {c}*dt")))
        text = law.format(x=x, y=y, c=c, i=_index_of(loop))
        for name, member in spec.entry("differential", "w", loop, equation=text):
            spec.differential[name] = spec.flat(text, member)


def _is_clear(points: jets.Floats) -> bool:
    """Whether a body is flat or is not: one that is a little off its plane is described in another way."""
    offsets = points - points[0]
    size = np.linalg.norm(offsets, axis=1).max()
    directions = np.zeros((0, 3))
    for _ in range(3):
        rest = offsets - offsets @ directions.T @ directions
        lengths = np.linalg.norm(rest, axis=1) / size
        if ((lengths > 1e-9) & (lengths < 0.03)).any():
            return False
        off = np.flatnonzero(lengths >= 0.03)
        if not off.size:
            break
        directions = np.vstack([directions, rest[off[0]] / np.linalg.norm(rest[off[0]])])
    return True


def _equations(draw: st.DrawFn, cast: Cast) -> list[tuple[Loop, str]]:
    """Left sides of holonomic laws that may be declared."""
    laws: list[tuple[Loop, str]] = []
    for loop, one, other in cast.pairs:
        patterns = (
            "distance({a}, {b})",
            "dot({a} - {b}, {a} - {b})/2",
            "{a} - {b}",
            "{a}.z - {i}*{b}.x",
            "{f}*{g}",
        )
        words = {"f": draw(formulas(components(one), 1)), "g": draw(formulas(components(other), 1))}
        text = draw(st.sampled_from((*patterns[:2], *patterns)))
        laws.append((loop, text.format(a=one, b=other, i=_index_of(loop), **words)))
    for loop, one in cast.singles:
        patterns = (
            "norm({a})",
            "{a}.z - s*{a}.x",
            "dot({a}, n3) + {i}*t",
            "{f} + {i}*sin(t)",
            "{a}.y*{i} - t",
        )
        text = draw(st.sampled_from(patterns))
        laws.append((loop, text.format(a=one, i=_index_of(loop), f=draw(formulas(components(one))))))
    for loop, one in cast.rates:
        text = draw(st.sampled_from(("{u}**2 - {f}*t", "{u} - i*sin(t)/2", "{u} + {f}")))
        laws.append((loop, text.format(u=one, f=draw(formulas(cast.wholes, 1)))))
    laws.append((ALONE, draw(formulas(cast.wholes))))
    return laws


def _family_outputs(draw: st.DrawFn, spec: Families, cast: Cast) -> None:
    for loop, one in cast.singles:
        if draw(st.booleans()):
            text = draw(st.sampled_from((f"cross({one}, {one}.v) + {_index_of(loop)}*n3", f"{one}.vx*{one}.y",
                                         draw(formulas([*components(one), *cast.wholes[:3], "t"])))))  # fmt: skip
            for name, member in spec.entry("outputs", f"o{len(spec.entries)}", loop, expression=text):
                spec.outputs[name] = spec.flat(text, member)
    for loop, one in cast.rates:
        if draw(st.booleans()):
            for name, member in spec.entry("outputs", "speed", loop, expression=f"i*rate({one})"):
                spec.outputs[name] = spec.flat(f"i*rate({one})", member)
