"""Reference problems as model texts, in generalized coordinates and as real particles.

Constraints are named h1, h2, ... (holonomic) and n1, n2, ... (differential), in the order of the reference
multipliers. In the particle form the coordinates x, y, z with a common ending make one particle: x1, y1
belong to p1. Components the data do not name start at zero, at rest, and feel no force.
"""

import fractions
import json
import pathlib
import re
from collections.abc import Callable

DATA = pathlib.Path(__file__).parents[1] / "reference"
WORD = re.compile(r"[A-Za-z_]\w*")


def problems() -> dict[str, dict]:
    """The problems by name, as the file has them."""
    return json.loads((DATA / "problems.json").read_text(encoding="utf-8"))["problems"]


def systems() -> dict[str, dict]:
    """The Pfaffian systems by name."""
    found = json.loads((DATA / "pfaffian.json").read_text(encoding="utf-8"))["systems"]
    return {system["name"]: system for system in found}


def frameworks() -> dict[str, dict]:
    """Ranks of well-known frameworks by name."""
    found = json.loads((DATA / "pfaffian.json").read_text(encoding="utf-8"))["rank_and_dof"]
    return {row["name"]: row for row in found}


def rows(problem: dict) -> list[str]:
    """Names of the constraint rows, in the order of the multipliers."""
    whole = [f"h{i}" for i in range(1, len(problem.get("holonomic", ())) + 1)]
    return whole + [f"n{i}" for i in range(1, len(problem.get("pfaffian", ())) + 1)]


def grid(problem: dict) -> tuple[float, float]:
    """Duration and output step that put a row at every reference time."""
    times = [fractions.Fraction(point["t"]) for point in problem["reference"]]
    step = times[0]
    for time in times[1:]:
        while time:
            step, time = time, step % time
    return float(max(times)), float(step)


def components(problem: dict) -> dict[str, str] | None:
    """Coordinate -> component of a particle (`x1` -> `p1.x`), or None where there is no such way."""
    if problem["form"] != "particles":
        return None
    found = {}
    for q in problem["coords"]:
        match = re.fullmatch(r"([xyz])(\w*)", q)
        if match is None:
            return None
        found[q] = f"p{match[2]}.{match[1]}"
    return found


def as_coordinates(problem: dict) -> str:
    """The problem in generalized coordinates: kinetic energy and forces of the coordinates themselves."""
    qs = problem["coords"]
    rename = _renamer({f"v{q}": f"rate({q})" for q in qs})
    constants, shorthand = _split(problem, rename)
    initial = problem["initial"]
    kinetic = [f"({_mass(problem, q)})*rate({q})**2/2" for q in qs] if problem["form"] == "particles" else []
    lagrangian = " + ".join(kinetic) or rename(problem["L"])
    start = {q: f"{{value: {_text(initial[q])}, rate: {_text(initial[f'v{q}'])}}}" for q in qs}
    forces = {q: rename(force) for q, force in _forces(problem).items()}
    return _document(
        ("parameters", constants),
        ("coordinates", start),
        ("definitions", shorthand),
        ("lagrangian", _text(lagrangian)),
        ("forces", {f"F_{q}": f"{{to: {q}, force: {_text(force)}}}" for q, force in forces.items()}),
        *_laws(problem, rename),
    )


def as_particles(problem: dict) -> str | None:
    """The problem with real particles, or None where its coordinates are no components of particles."""
    named = components(problem)
    if named is None:
        return None
    rename = _renamer(named | {f"v{q}": place.replace(".", ".v") for q, place in named.items()})
    constants, shorthand = _split(problem, rename)
    backwards = {place: q for q, place in named.items()}
    initial, given = problem["initial"], _forces(problem)
    particles, forces = {}, {}
    for name in dict.fromkeys(place.partition(".")[0] for place in named.values()):
        axes = [backwards.get(f"{name}.{axis}") for axis in "xyz"]
        own = [q for q in axes if q is not None]
        position = ", ".join(_text(initial[q]) if q else "0" for q in axes)
        velocity = ", ".join(_text(initial[f"v{q}"]) if q else "0" for q in axes)
        mass = _text(_mass(problem, own[0]))
        particles[name] = f"{{mass: {mass}, position: [{position}], velocity: [{velocity}]}}"
        force = ", ".join(_text(rename(given[q])) if q in given else "0" for q in axes)
        if any(q in given for q in own):
            forces[f"F_{name}"] = f"{{to: {name}, force: [{force}]}}"
    return _document(
        ("parameters", constants),
        ("particles", particles),
        ("definitions", shorthand),
        ("forces", forces),
        *_laws(problem, rename),
    )


def _mass(problem: dict, q: str) -> str:
    masses = problem["masses"]
    return masses[q] if isinstance(masses, dict) else masses


def _forces(problem: dict) -> dict[str, str]:
    return problem.get("forces") or problem.get("Q") or {}


def _split(problem: dict, rename: Callable[[str], str]) -> tuple[dict[str, str], dict[str, str]]:
    """Parameters that are constant, and those that vary with the state and become definitions."""
    moving = {*problem["coords"], *(f"v{q}" for q in problem["coords"]), "t"}
    constants, shorthand = {}, {}
    for name, text in problem.get("params", {}).items():
        if moving & set(WORD.findall(text)):
            moving.add(name)
            shorthand[name] = _text(rename(text))
        else:
            constants[name] = _text(text)
    return constants, shorthand


def _laws(problem: dict, rename: Callable[[str], str]) -> list[tuple[str, dict[str, str]]]:
    names = iter(rows(problem))
    whole = {next(names): _text(rename(law)) for law in problem.get("holonomic", ())}
    forms = {}
    for form in problem.get("pfaffian", ()):
        terms = (
            f"({rename(weight)})*" + ("dt" if q in ("t", "b") else f"d({rename(q)})")
            for q, weight in form.items()
        )
        forms[next(names)] = _text(" + ".join(terms))
    return [("holonomic", whole), ("differential", forms)]


def _renamer(names: dict[str, str]) -> Callable[[str], str]:
    return lambda text: WORD.sub(lambda word: names.get(word[0], word[0]), text)


def _text(expression: str) -> str:
    return json.dumps(expression)


def _document(*sections: tuple[str, dict[str, str] | str]) -> str:
    lines = ["lagcli: 1"]
    for key, content in sections:
        if isinstance(content, str):
            lines.append(f"{key}: {content}")
        elif content:
            lines.append(f"{key}:")
            lines += [f"  {name}: {value}" for name, value in content.items()]
    return "\n".join(lines) + "\n"


def as_forms(system: dict) -> str:
    """A Pfaffian system as differential constraints n1, n2, ... of coordinates with unit masses."""
    qs = [q for q in system["coords"] if q != "t"]
    known = {*system["coords"], "sin", "cos", "tan", "exp", "log", "sqrt", "pi"}
    letters = sorted(set(WORD.findall(json.dumps(system["forms"]))) - known)
    forms = {}
    for n, form in enumerate(system["forms"], 1):
        terms = (
            f"({weight})*" + ("dt" if q == "t" else f"d({q})")
            for q, weight in zip(system["coords"], form, strict=True)
            if str(weight) != "0"
        )
        forms[f"n{n}"] = _text(" + ".join(terms))
    return _document(
        ("parameters", dict.fromkeys(letters, "0.7")),
        ("coordinates", {q: f"{{value: {0.3 + 0.2 * i:.1f}}}" for i, q in enumerate(qs)}),
        ("lagrangian", _text(" + ".join(f"rate({q})**2/2" for q in qs))),
        ("differential", forms),
    )
