"""The page of an animation: its size, what stands in it, and that no text of a model gets out of its place."""

from __future__ import annotations

import base64
import hashlib
import html.parser
import json
import pathlib
import re

import numpy as np
import pytest

import lagcli
from lagcli.api import animate
from lagcli.output.animation import page
from lagcli.output.animation.scene import Scene

MODELS = pathlib.Path(__file__).resolve().parents[2] / "models"
HOSTILE = [
    "</script><script>alert(1)</script>",
    "<!-- <script>",
    "]]> & <img src=x onerror=alert(1)> \" ' `${1}` $TITLE $$ \\u003c",
    "\u202eright to left\u202c שלום مرحبا",
    "a\x1b[31mred \u2028 line \x07\x9b2J",
    "x" * 2000,
]


class Tags(html.parser.HTMLParser):
    """The tags of a page, the texts of its scripts and its title."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.texts: dict[str, list[str]] = {}
        self._inside = ""
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        self._inside = tag
        self.texts.setdefault(tag, []).append("")

    def handle_endtag(self, tag: str) -> None:
        self._inside = ""

    def handle_data(self, data: str) -> None:
        if self._inside:
            self.texts[self._inside][-1] += data


def small(title: str = "Pendulum") -> Scene:
    text = f"""
lagcli: 1
title: {json.dumps(title)}
particles: {{a: {{mass: 1, position: [1, 0, 0]}}}}
forces: {{weight: {{to: all, force: [0, 0, -9.81*m]}}}}
holonomic: {{rod: norm(a) = 1}}
simulation: {{duration: 1, samples: 11}}
"""
    return animate.as_far(lagcli.loads(text), {})[0]


@pytest.mark.parametrize("title", HOSTILE)
def test_titles_stay_text(title: str) -> None:
    text = page.text(small(title))
    plain, found = Tags(page.text(small())), Tags(text)
    assert [tag for tag, _ in found.tags] == [tag for tag, _ in plain.tags]
    assert not any(name.startswith("on") for _, attributes in found.tags for name in attributes)
    assert len(found.texts["h1"][0]) <= 300
    assert all(letter.isprintable() or letter == "\n" for letter in text.split("<script", 1)[0])
    assert json.loads(found.texts["script"][0])["count"] == 1


def test_names_of_columns_and_files_stay_text(tmp_path: pathlib.Path) -> None:
    table = tmp_path / "run.json"
    names = ["</script><b>", "\u202egnp", "y" * 2000]
    columns = ["t", *(f"{name}.{part}" for name in names for part in ("x", "y", "z", "vx"))]
    columns += [f"lambda.{name}" for name in names]
    table.write_text(json.dumps({"columns": columns, "rows": [[k] * len(columns) for k in range(3)]}))
    text = page.text(animate.of_file(table, None))
    assert {tag for tag, _ in Tags(text).tags} <= {tag for tag, _ in Tags(page.text(small())).tags}
    assert [tag for tag, _ in Tags(text).tags].count("script") == 4
    data = json.loads(Tags(text).texts["script"][0])
    assert data["names"][0] == "</script><b>"
    assert len(data["names"][2]) <= 100
    assert "\u202e" not in text


def test_the_policy_names_the_scripts_and_styles_that_are_there() -> None:
    text = page.text(small())
    found = Tags(text)
    (policy,) = [a["content"] for tag, a in found.tags if tag == "meta" and a.get("http-equiv")]
    assert policy is not None

    def hashed(content: str) -> str:
        return "'sha256-" + base64.b64encode(hashlib.sha256(content.encode()).digest()).decode() + "'"

    scripts = re.findall(r"<script>(.*?)</script>", text, re.DOTALL)
    assert len(scripts) == 2
    for script in scripts:
        assert hashed(script) in policy
    assert hashed(found.texts["style"][0]) in policy
    assert policy.startswith("default-src 'none';")
    assert "unsafe" not in policy
    assert not any("style" in attributes for _, attributes in found.tags)


def test_a_page_needs_nothing_else() -> None:
    found = Tags(page.text(small()))
    assert not any(attributes.get("src") or attributes.get("href") for _, attributes in found.tags)


def test_the_licence_of_the_library_is_in_the_page() -> None:
    text = page.text(small())
    assert "Permission is hereby granted, free of charge" in text
    assert "three.js authors" in text
    kept = (page.ASSETS / "three.LICENSE.txt").read_text(encoding="utf-8").strip()
    assert kept in text


def test_the_library_is_the_one_whose_hash_is_written_down() -> None:
    record = next(pathlib.Path(MODELS.parent / "docs/explanation/decisions").glob("*three-js.md"))
    digest = hashlib.sha256((page.ASSETS / page.LIBRARY).read_bytes()).hexdigest()
    assert digest in record.read_text(encoding="utf-8")


def test_numbers_are_those_of_the_scene() -> None:
    scene = small()
    found = Tags(page.text(scene)).texts["script"]
    data = json.loads(found[0])
    numbers = np.frombuffer(base64.b64decode(found[1]), dtype="<f4")

    def part(place: list[int]) -> np.ndarray:
        return numbers[place[0] : place[0] + place[1]].reshape(-1, 3).astype(float)

    np.testing.assert_allclose(
        part(data["points"][0]) * data["size"] + data["centre"], scene.points[0], atol=1e-6
    )
    np.testing.assert_allclose(part(data["R"][0]) / data["scale"], scene.R[0], rtol=1e-6, atol=1e-5)
    np.testing.assert_allclose(part(data["F"][0]) / data["scale"], [[0, 0, -9.81]], rtol=1e-6)


def test_numbers_of_any_unit_keep_their_digits() -> None:
    text = """
lagcli: 1
parameters: {L: 1e-30, m: 1e-25, T: 1e-20}
particles: {a: {mass: m, position: [L, 0, 0]}}
forces: {weight: {to: all, force: [0, 0, -9.81*m*L/T**2]}}
holonomic: {rod: norm(a) = L}
simulation: {start: 1e9*T, duration: T, samples: 11}
"""
    scene = animate.as_far(lagcli.loads(text), {})[0]
    found = Tags(page.text(scene)).texts["script"]
    data = json.loads(found[0])
    numbers = np.frombuffer(base64.b64decode(found[1]), dtype="<f4").astype(float)

    def part(place: list[int]) -> np.ndarray:
        return numbers[place[0] : place[0] + place[1]]

    np.testing.assert_allclose(np.diff(part(data["t"])), 1e-21, rtol=1e-5)
    curve = data["curves"][0]
    np.testing.assert_allclose(
        part(curve["values"]) * curve["unit"], next(iter(scene.curves.values())), rtol=1e-6, atol=1e-20
    )
    np.testing.assert_allclose(part(data["F"][0])[2] / data["scale"], -9.81e-15, rtol=1e-6)
    track = part(data["points"][0]).reshape(-1, 3) * data["size"] + data["centre"]
    np.testing.assert_allclose(np.linalg.norm(track, axis=1), 1e-30, rtol=1e-5)


MANY = """
lagcli: 1
particles:
  p[i]: {{for: "i = 1..{count}", mass: 1, position: "[i*0.1, 0, 0]", velocity: "[0, sin(i), cos(i)]"}}
forces:
  spring[i]: {{potential: "dot(p[i], p[i])*(1 + i/50)", for: "i = 1..{count}"}}
simulation: {{duration: 10, samples: 1001}}
"""


def many(count: int, **settings: object) -> Scene:
    return animate.as_far(lagcli.loads(MANY.format(count=count)), settings | {"rtol": 1e-6, "atol": 1e-6})[0]


def test_a_hundred_particles_for_ten_seconds_are_below_two_megabytes() -> None:
    scene = many(100)
    text = page.text(scene)
    assert len(text.encode()) < page.MOST_BYTES
    assert len(scene.t) >= 150
    assert any("of 1001 rows are shown" in note for note in scene.notes)
    assert scene.t[0] == 0
    assert scene.t[-1] == 10


def test_a_thousand_particles_leave_forces_out_and_say_so() -> None:
    scene = many(1000, duration=1, samples=101)
    assert len(page.text(scene).encode()) < page.MOST_BYTES
    assert any("F is left out" in note for note in scene.notes)


def test_the_still_is_a_drawing_with_all_parts() -> None:
    scene = animate.as_far(MODELS / "double-pendulum.yaml", {"samples": 5})[0]
    drawn = page.svg(scene)
    found = Tags(drawn)
    names = [tag for tag, _ in found.tags]
    assert names.count("circle") == 2
    assert names.count("path") == 2
    assert "style=" not in drawn
