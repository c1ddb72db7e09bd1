"""The schema for editors says what the reader says, as far as shapes go."""

import functools
import pathlib
from collections.abc import Iterator

import jsonschema
import pytest

import lagcli
from lagcli import yaml_tree
from lagcli.errors import catalogue, diagnostics
from lagcli.input import format_schema, keys

ROOT = pathlib.Path(__file__).parents[2]
MODELS = sorted((ROOT / "models").glob("*.yaml"))

# Every section and key once; the examples of the keys fit into it.
FULL = """\
lagcli: 1
title: 12
description: all keys
source: here
units: {length: mm, mass: g, time: ms}
parameters: {m: 2, L: 1, g: 9.81, k: 3, J: 1, N: 3, down: [0, 0, -1], up: -down}
coordinates:
  theta: {value: 0.5, rate: 0}
  phi: 0.25
  psi:
  "u[i]": {for: i = 1..N, if: i != 2, value: i, rate: 0}
particles:
  a: {mass: m, position: [L, 0, 0], velocity: [0, 0, 0]}
  b: {mass: 2*m, position: "[2*L, 0, 0]"}
  c: {mass: m, position: [L, L, 0]}
  d: {mass: m, position: [L*sin(theta), 0, -L*cos(theta)]}
  e: {mass: m, position: [5, 5, 5]}
  "p[i]": {for: [i = 1..N+1], if: i != 99, mass: m, position: [i*L, 0, 7]}
  "s[i]": {for: i = 1..N, if: i != 99, mass: m, position: [i, 9, 9]}
definitions: {gap: "distance(a, e) - L"}
lagrangian: J/2*rate(theta)**2 + rate(phi)**2 + rate(psi)**2
forces:
  weight: {to: all, force: [0, 0, -m*g]}
  torque: {to: theta, force: 1}
  motor: {to: crank, torque: [0, 1, 0]}
  twist: {between: [crank, ball], torque: [0, 1, 0]}
  spring: {potential: k/2*norm(e)**2}
  "wind[i]": {for: i = 1..N, if: i != 99, to: "p[i]", force: "[i, 0, 0]"}
  kinetic_like: {to: "u[1]", force: 1}
  inertia: {potential: "u[1]**2"}
holonomic:
  rod: e.z = 5
  "link[i]": {for: i = 1..N-1, if: i != 2, equation: "distance(p[i], p[i+1]) = L"}
  long: {equation: e.x = 5}
differential:
  skate: cos(theta)*d(a.y) - sin(theta)*d(a.x) = 0
  "slow[i]": {for: i = 3..3, if: i != 99, equation: "d(p[i].z) = 0"}
inequality:
  floor: a.z >= -20*L
  wall: {condition: a.x <= 90, restitution: 0.8}
  "side[i]": {for: i = 2..N, if: i != 99, condition: "p[i].x <= 90"}
rigid: {body: [a, b, c]}
bodies:
  crank:
    {mass: 2, inertia: [0.1, 0.2, 0.2], about: corner, center: [9, 0, 0], orientation: {axis: [0, 1, 0], angle: 0.1},
     velocity: [0, 0, 0], angular_velocity: [0, 1, 0], points: {corner: [0.1, 0, 0]}, planar: false}
  ball: {shape: {sphere: {mass: 1, radius: 0.2}}, center: [9, 0, 1], pivot: [9, 0, 0], spin: [0, 1, 0]}
  can:
    {shape: {cylinder: {mass: 1, radius: 0.2, length: 1}}, center: [9, 1, 1], orientation: {quaternion: [1, 0, 0, 0]}}
  box:
    {shape: {box: {mass: 1, size: [1, 2, 3]}}, center: [9, 2, 1],
     orientation: {matrix: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}}
  stick: {shape: {rod: {mass: 1, length: 1}}, center: [9, 3, 1], orientation: {euler: [z, x, z, [0.1, 0.2, 0.3]]}}
  wheel: {shape: {disk: {mass: 1, radius: 0.3}}, center: [9, 4, 0.3], orientation: {axis: [1, 0, 0], angle: 90*deg},
    roll: true}
  pipe: {shape: {tube: {mass: 1, radius: 0.3, inner: 0.2, length: 1}}, center: [9, 5, 1]}
  "free[i]": {for: i = 1..N, if: i != 99, mass: 1, inertia: [1, 1, 1], center: [9, 7, i]}
  "bar[i]": {for: i = 1..N, if: i != 99, mass: 1, inertia: [1, 1, 1], center: [9, 6, i]}
joints:
  j1: {revolute: [ground, crank], at: [9, 0, 0], axis: [0, 1, 0]}
  j2: {spherical: [crank, ball], at: [9, 0, 0]}
  j3: {fixed: [crank, ball], at: [9, 0, 0]}
  j4: {prismatic: [crank, ball], at: [9, 0, 0], axis: [0, 1, 0]}
  j5: {cylindrical: [crank, ball], at: [9, 0, 0], axis: [0, 1, 0]}
  j6: {point_on_line: [crank, ball], at: [9, 0, 0], axis: [0, 1, 0]}
  j7: {universal: [crank, ball], at: [9, 0, 0], axes: [[1, 0, 0], [0, 1, 0]]}
  j8: {hooke: [crank, ball], axes: [[1, 0, 0], [0, 1, 0]]}
  j9: {planar: [crank, ball], at: [9, 0, 0], normal: [0, 0, 1]}
  j10: {point_on_plane: [crank, ball], at: [9, 0, 0], normal: [0, 0, 1]}
  j11: {screw: [crank, can], at: [9, 0, 0], axis: [0, 1, 0], pitch: 0.01}
  j12: {distance: [crank, can], at: [[9, 0, 0], [9, 1, 1]]}
  j13: {gear: [crank, can], axis: [0, 1, 0], radii: [0.1, 0.2]}
  j14: {rack: [crank, can], axis: [0, 1, 0], along: [1, 0, 0], radius: 0.1}
  j15: {rolling: wheel, axis: [0, 1, 0], radius: 0.3, on: {point: [0, 0, 0], normal: [0, 0, 1]}}
  "j17[i]": {for: i = 1..N, spherical: [ground, "bar[i]"], at: [9, 6, i]}
  "j16[i]": {for: i = 2..N, if: i != 99, spherical: ["bar[i-1]", "bar[i]"], at: [9, 6, i-1/2]}
outputs:
  speed: norm(a.v)
  push: reaction(a)
  "h[i]": {for: i = 1..N, if: i != 99, expression: "p[i].z"}
events:
  lowest: {when: a.vz, direction: up, action: record}
  taut: {when: multiplier(rod) - 20}
simulation:
  {start: 0, duration: 1, samples: 11, method: auto, compile: auto, rtol: 1e-9, atol: 1e-12, max_step: 0.1,
   assemble: true, keep: [theta, e.x]}
"""


@functools.cache
def validator() -> jsonschema.Draft7Validator:
    return jsonschema.Draft7Validator(format_schema.schema())


def faults(text: str) -> list[str]:
    values = format_schema.plain(yaml_tree.parse(text, "model.yaml"))
    return [f"{list(error.absolute_path)}: {error.message}" for error in validator().iter_errors(values)]


def has_faults(text: str) -> bool:
    """True if there is a fault: the first is looked for, and not worded."""
    return not validator().is_valid(format_schema.plain(yaml_tree.parse(text, "model.yaml")))


def codes(text: str) -> set[str]:
    try:
        lagcli.loads(text)
    except diagnostics.ModelError as error:
        return {found.code for found in error.diagnostics}
    return set()


def test_it_is_a_schema() -> None:
    jsonschema.Draft7Validator.check_schema(format_schema.schema())


@pytest.mark.parametrize("path", MODELS, ids=lambda path: path.stem)
def test_models_of_the_gallery_are_valid(path: pathlib.Path) -> None:
    assert faults(path.read_text(encoding="utf-8")) == []


def test_a_model_with_every_key_is_valid() -> None:
    assert codes(FULL) == set()
    assert faults(FULL) == []
    written = {name.value for name, _ in yaml_tree.parse(FULL, "")}
    assert written == set(keys.FORMAT.names)


def test_mended_examples_of_the_error_pages_are_valid() -> None:
    pages = [found for code in catalogue.codes() if (found := catalogue.page(code)) is not None]
    texts = [page.fixed for page in pages if page.stage != "input"]
    good = [text for text in texts if not codes(text)]
    assert len(good) > 50
    assert [text for text in good if faults(text)] == []


# What is wrong with the shape of a model, and so is seen in an editor.
SHAPES = (
    "unknown-key", "missing-key", "not-a-mapping", "vector-length", "unknown-version", "not-a-text",
)  # fmt: skip


@pytest.mark.parametrize("code", [code for code in SHAPES if code in catalogue.codes()])
def test_examples_of_wrong_shapes_are_not_valid(code: str) -> None:
    page = catalogue.page(code)
    assert page is not None
    assert code in codes(page.example)
    assert faults(page.example)


def walk(key: keys.Key, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], keys.Key]]:
    for one in key.keys:
        yield (*path, one.name), one
        yield from walk(one, (*path, one.name))


ALL = list(walk(keys.FORMAT))


@pytest.mark.parametrize(("path", "key"), ALL, ids=[".".join(path) for path, _ in ALL])
def test_every_key_has_a_description_and_an_example_that_the_reader_takes(
    path: tuple[str, ...], key: keys.Key
) -> None:
    found = format_schema.schema()
    for name in path:
        entry = found.get("additionalProperties") or found
        forms = [found, entry, *entry.get("anyOf", ())]
        found = next(form for form in forms if name in form.get("properties", {}))["properties"][name]
    assert found["description"].endswith(".")
    (example,) = found["examples"]
    assert jsonschema.Draft7Validator(found).is_valid(example)
    texts = list(with_example(path, key))
    assert texts
    assert any(not codes(text) and not faults(text) for text in texts)


def with_example(path: tuple[str, ...], key: keys.Key) -> Iterator[str]:
    """FULL with the example of a key in each place where this key stands; as one more entry for a whole section."""
    section = keys.FORMAT.key(path[0])
    node = yaml_tree.parse(FULL, "").get(path[0])
    assert node is not None
    if section.entries and len(path) == 1:
        example = yaml_tree.parse(f"key: {key.example}", "").entries[0][1]
        assert isinstance(example, yaml_tree.Mapping)
        value = example.entries[0][1]
        yield with_entry(node, value.text.content[value.start : value.end])
        return
    if len(path) == 1:
        yield put(node, key.example)
        return
    assert isinstance(node, yaml_tree.Mapping)
    entries = [value for _, value in node] if section.entries else [node]
    while entries:
        entry = entries.pop()
        for name, value in entry if isinstance(entry, yaml_tree.Mapping) else ():
            entries.append(value)
            if name.value == path[-1]:
                yield put(value, quoted(key.example))
            elif name.value in key.instead_of and not section.entries:
                yield FULL[: name.start] + f"{key.name}: {key.example}" + FULL[value.end :]


def quoted(example: str) -> str:
    return example if example.startswith(("[", "{")) else f'"{example}"'


def put(node: yaml_tree.AnyNode, text: str) -> str:
    return FULL[: node.start] + text + FULL[node.end :]


def with_entry(section: yaml_tree.AnyNode, entry: str) -> str:
    """FULL with one more entry of a section, under a name of its own."""
    if FULL[section.end - 1] == "}":
        return FULL[: section.end - 1] + f", w: {entry}}}" + FULL[section.end :]
    end = section.end
    return FULL[:end].rstrip() + f"\n  w: {entry}\n" + FULL[end:]


def mutants() -> Iterator[tuple[str, str]]:
    """FULL with one value of it replaced by one of another shape, or given a key that there is not."""
    root = yaml_tree.parse(FULL, "")
    waiting: list[tuple[str, yaml_tree.AnyNode]] = [("", root)]
    while waiting:
        path, node = waiting.pop()
        if isinstance(node, yaml_tree.Mapping):
            waiting += [(f"{path}.{name.value}", value) for name, value in node]
        if node is root or "." not in path.strip(".") or yaml_tree.is_empty(node):
            continue
        before, after = FULL[: node.start], FULL[node.end :]
        written = FULL[node.start : node.end]
        for new in ("[1]", "{nope: 1}", "[1, 2, 3]", "[[1], 2, 3]", "x y z", "{}"):
            yield f"{path} -> {new}", f"{before}{new}{after}"
        if written.startswith("{"):
            yield f"{path} + nope", f"{before}{{nope: 1, {written[1:]}{after}"


# Refusals that are about shapes alone. `missing-value` is left out: `{}` and nothing are one to the reader.
ABOUT_SHAPES = {
    "unknown-key", "not-a-mapping", "not-a-text", "not-an-expression", "vector-length", "not-a-name",
}  # fmt: skip


def test_reader_and_schema_judge_shapes_alike() -> None:
    checked = 0
    for label, text in mutants():
        found = codes(text)
        if not found and label != ".simulation.keep -> {}":  # nothing at all, to the reader
            assert faults(text) == [], label
        # Whether a force is a vector depends on what it acts on.
        if found & ABOUT_SHAPES and ".force -> " not in label:
            assert has_faults(text), (label, found)
            checked += 1
    assert checked > 100


def test_unknown_keys_are_named() -> None:
    (fault,) = faults(FULL.replace("method: auto", "methd: auto"))
    assert "methd" in fault
    assert codes(FULL.replace("method: auto", "methd: auto")) == {"unknown-key"}
    (fault,) = faults(FULL.replace("rigid:", "rigd:"))
    assert "rigd" in fault


@pytest.mark.parametrize("name", ["3a", "a-b", "a b", "", "t", "all", "a.b"])
def test_names_are_those_of_the_reader(name: str) -> None:
    text = f"lagcli: 1\nparticles: {{'{name}': {{mass: 1, position: [0, 0, 0]}}}}\n"
    assert codes(text) == {"bad-name"}
    assert faults(text)


@pytest.mark.parametrize("name", ["a", "_", "a1", "e", "no", "y", "Ölscheibe", "θ", "p[1]", "p[1][2]"])
def test_names_that_may_be_given(name: str) -> None:
    text = f"lagcli: 1\nparticles: {{'{name}': {{mass: 1, position: [0, 0, 0]}}}}\n"
    assert codes(text) == set()
    assert faults(text) == []


def test_scalars_are_what_editors_take_them_for() -> None:
    root = yaml_tree.parse(
        "{a: 1e3, b: 'no', c: no, d: true, e: , f: '1', g: [1, -2.5, x], h: ~, i: 0x10}", ""
    )
    wanted = {
        "a": 1000.0,
        "b": "no",
        "c": "no",
        "d": True,
        "e": None,
        "f": "1",
        "g": [1, -2.5, "x"],
        "h": None,
    }
    assert format_schema.plain(root) == {**wanted, "i": "0x10"}
