"""Strategies for whole models that are valid by construction: the start satisfies all that is declared."""

from __future__ import annotations

import jets
import numpy as np
from hypothesis import strategies as st

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
        spec.potentials["spring"] = f"k/2*(distance({i}, {j}) - L)**2"
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
        right = f"[{', '.join(map(repr, parts))}]" if len(parts) == 3 else repr(parts[0])
        spec.holonomic[name] = f"{right} = {text}" if draw(st.booleans()) else f"{text} = {right}"
    if draw(st.integers(0, 9)):
        while (spec.holonomic or spec.differential) and not _independent(oracle.constraints(0.0, q, v)[0]):
            (spec.differential or spec.holonomic).popitem()
    B, b, _, _ = oracle.constraints(0.0, q, v)
    if len(b):
        v = v - np.linalg.lstsq(B, B @ v + b, rcond=1e-10)[0]
        v[np.abs(v) < 1e-12] = 0.0
    spec.set_start(q, v)
    return spec


def _independent(B: jets.Floats) -> bool:
    lengths = np.linalg.norm(B, axis=1)
    if not B.size or lengths.min() < 1e-3:
        return not B.shape[0]
    sigma = np.linalg.svd(B / lengths[:, None], compute_uv=False)
    return len(sigma) == len(B) and bool(sigma.min() > 1e-2)
