"""The pages of animations in a browser: no error, arrows as long as R, the slider, keys, phones, less motion."""

from __future__ import annotations

import json
import pathlib
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import lagcli
from lagcli.api import animate
from lagcli.output.animation import page
from tests.helpers.browser import FLAGS, Browser, BrowserFailed, Page, found

MODELS = pathlib.Path(__file__).resolve().parents[2] / "models"
PROGRAM = found()
pytestmark = [
    pytest.mark.skipif(PROGRAM is None, reason="there is no browser"),
    pytest.mark.xdist_group("browser"),
]
PHONE = (390, 780)
NO_WEBGL = (*(flag for flag in FLAGS if "swiftshader" not in flag), "--disable-gpu", "--disable-3d-apis")


def started(flags: tuple[str, ...] = FLAGS) -> Browser:
    assert PROGRAM is not None
    try:
        return Browser(PROGRAM, flags)
    except BrowserFailed as reason:
        pytest.skip(str(reason))


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    running = started()
    yield running
    running.close()


@pytest.fixture(scope="module")
def pendulum(tmp_path_factory: pytest.TempPathFactory) -> pathlib.Path:
    path = tmp_path_factory.mktemp("pages") / "pendulum.html"
    page.write(path, animate.as_far(MODELS / "double-pendulum.yaml", {"samples": 201})[0])
    return path


def opened(browser: Browser, path: pathlib.Path, *arguments: Any, **features: Any) -> Page:
    shown = Page(browser, *arguments, **features)
    shown.open(path)
    assert shown.errors() == []
    return shown


def test_arrows_are_as_long_as_the_forces_and_balls_stand_at_their_positions(
    browser: Browser, pendulum: pathlib.Path
) -> None:
    run = lagcli.simulate(MODELS / "double-pendulum.yaml", samples=201)
    shown = opened(browser, pendulum)
    for row in (0, 57, 200):
        shown.value(f"animation.seek(animation.times[{row}])")
        for number, name in enumerate("ab"):
            R = float(np.linalg.norm(run.reaction(name)[row]))
            assert shown.value(f"animation.force('R', {number})") == pytest.approx(R, rel=1e-4)
            weight = 9.81 * (2, 1)[number]
            assert shown.value(f"animation.force('F', {number})") == pytest.approx(weight, rel=1e-4)
            place = [run[f"{name}.{axis}"][row] for axis in "xyz"]
            assert shown.value(f"animation.place({number})") == pytest.approx(place, abs=1e-5)
    assert shown.errors() == []


def test_slider_keys_and_buttons_move_the_time(browser: Browser, pendulum: pathlib.Path) -> None:
    shown = opened(browser, pendulum)
    assert shown.value("animation.playing()") is True
    shown.value(
        "byId = (id) => document.getElementById(id);"
        "byId('time').value = 0.5; byId('time').dispatchEvent(new Event('input'))"
    )
    assert shown.value("animation.time()") == pytest.approx(5)
    assert shown.value("animation.playing()") is False
    shown.value("byId('view').focus()")
    shown.key("ArrowRight")
    assert shown.value("animation.time()") == pytest.approx(5.05)
    shown.key("Home")
    assert shown.value("animation.time()") == 0
    shown.key("End")
    assert shown.value("animation.time()") == pytest.approx(10)
    shown.key(" ")
    assert shown.value("animation.playing()") is True
    cursor = "Number(document.querySelector('#chart .cursor').getAttribute('x1'))"
    shown.value("animation.seek(0)")
    begin = shown.value(cursor)
    shown.value("animation.seek(10)")
    assert shown.value(cursor) > begin + 100
    assert shown.value("byId('clock').textContent") == "t = 10.00 s"
    assert shown.errors() == []


def test_dragging_turns_the_picture_and_reset_turns_it_back(
    browser: Browser, pendulum: pathlib.Path, tmp_path: pathlib.Path
) -> None:
    shown = opened(browser, pendulum)
    shown.value("animation.seek(1)")

    def picture() -> str:
        shown.value("animation.seek(1)")
        return str(shown.value("document.getElementById('view').toDataURL()"))

    before = picture()
    shown.drag((300, 300), (420, 340))
    assert picture() != before
    shown.value("document.getElementById('reset').click()")
    assert picture() == before


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_phone_shows_everything_without_scrolling_aside(
    browser: Browser, pendulum: pathlib.Path, scheme: str
) -> None:
    shown = opened(browser, pendulum, PHONE, mobile=True, prefers_color_scheme=scheme)
    assert shown.value("document.documentElement.scrollWidth") <= PHONE[0]
    for name in ("view", "chart", "play", "time", "speed"):
        box = json.loads(
            shown.value(f"JSON.stringify(document.getElementById('{name}').getBoundingClientRect())")
        )
        assert box["width"] > 30, name
        assert box["left"] >= 0, name
        assert box["right"] <= PHONE[0], name
        assert box["bottom"] <= PHONE[1], name
    assert (
        json.loads(shown.value("JSON.stringify(document.getElementById('view').getBoundingClientRect())"))[
            "height"
        ]
        > 200
    )
    back = shown.value("getComputedStyle(document.body).backgroundColor")
    assert back == ("rgb(255, 255, 255)" if scheme == "light" else "rgb(20, 23, 27)")


def test_less_motion_begins_at_rest(browser: Browser, pendulum: pathlib.Path) -> None:
    shown = opened(browser, pendulum, prefers_reduced_motion="reduce")
    assert shown.value("animation.playing()") is False


def test_something_is_drawn(browser: Browser, pendulum: pathlib.Path) -> None:
    shown = opened(browser, pendulum, prefers_color_scheme="light")
    shown.value("animation.seek(1)")
    count = shown.value(
        "(() => { const c = document.createElement('canvas'), v = document.getElementById('view');"
        "c.width = v.width; c.height = v.height; const x = c.getContext('2d'); x.drawImage(v, 0, 0);"
        "const d = x.getImageData(0, 0, c.width, c.height).data; let n = 0;"
        "for (let i = 0; i < d.length; i += 4) if (d[i] < 250 || d[i + 1] < 250 || d[i + 2] < 250) n++; return n; })()"
    )
    assert count > 2000


def test_paper_gets_a_still(browser: Browser, pendulum: pathlib.Path) -> None:
    shown = opened(browser, pendulum, prefers_color_scheme="dark")
    printed = shown.call("Page.printToPDF")["data"]
    assert len(printed) > 10_000
    assert shown.value("document.getElementById('still').src.length") > 5_000
    assert shown.errors() == []


KINDS = """
    triangle-on-sphere particle-in-a-box moving-ramp-stick rope-slack-and-taut water-slide sphere-pile
    bead-on-rotating-hoop-cartesian stadium spring-triangle rolling-disk hoop-on-ramp
""".split()


@pytest.mark.parametrize("name", KINDS)
def test_models_of_all_kinds_run_without_an_error(
    browser: Browser, name: str, tmp_path: pathlib.Path
) -> None:
    path = tmp_path / "page.html"
    page.write(path, animate.as_far(MODELS / f"{name}.yaml", {"samples": 21})[0])
    shown = opened(browser, path)
    for row in (0, 10, 20):
        shown.value(f"animation.seek(animation.times[{row}])")
    for box in ("R", "F", "trails", "surfaces", "names"):
        shown.value(f"document.getElementById('show-{box}').click()")
        shown.value("animation.seek(animation.times[1])")
    assert shown.errors() == []


@pytest.mark.parametrize(
    "row", ["a.z = 0.1*sin(3*a.x - 2*t)", "a.y = 0\n  track: a.z = 0.1*sin(3*a.x - 2*t)"]
)
def test_lines_and_nets_move_with_the_time(browser: Browser, row: str, tmp_path: pathlib.Path) -> None:
    text = f"""
lagcli: 1
particles: {{a: {{mass: 1, position: [0, 0, 0], velocity: [0.3, 0, -0.11]}}}}
holonomic:
  row: {row}
simulation: {{duration: 1, samples: 11}}
"""
    scene, path = animate.as_far(lagcli.loads(text), {})[0], tmp_path / "page.html"
    (drawn,) = scene.surfaces
    page.write(path, scene)
    shown = opened(browser, path)
    for frame in (0, 4, 10):
        shown.value(f"animation.seek(animation.times[{frame}])")
        places = np.array(shown.value("animation.line(0)")).reshape(-1, 3)
        # Pieces begin and end at corners; one without a place stands at the centre.
        corners = np.concatenate([drawn.corners[frame], [scene.view.centre]])
        apart = np.linalg.norm(places[:, None] - corners[None], axis=-1)
        assert float(np.nanmin(apart, axis=1).max()) < 1e-5
        off = places[:, 2] - 0.1 * np.sin(3 * places[:, 0] - 2 * scene.t[frame])
        assert np.mean(np.abs(off) < 1e-3) > 0.9
    assert shown.errors() == []


def test_modes_are_chosen(browser: Browser, tmp_path: pathlib.Path) -> None:
    model = lagcli.load(MODELS / "spring-triangle.yaml")
    path, scene = tmp_path / "modes.html", animate.of_modes(model, lagcli.modes(model))
    page.write(path, scene)
    shown = opened(browser, path)
    assert shown.value("document.querySelectorAll('#modes option').length") == len(scene.modes)
    for k in (6, 8):
        shown.value(f"animation.seek(0.25); animation.choose({k})")
        assert shown.value("animation.place(1)") == pytest.approx(
            list(scene.modes[k].points[12, 1]), abs=1e-4
        )
    assert shown.errors() == []


def test_texts_of_a_model_run_nothing(browser: Browser, tmp_path: pathlib.Path) -> None:
    hostile = "</script><img src=x onerror=window.hit=1><script>window.hit=1</script>\u202e"
    table, path = tmp_path / "run.json", tmp_path / "page.html"
    columns = ["t", *(f"{hostile}.{part}" for part in ("x", "y", "z", "vx")), f"lambda.{hostile}"]
    table.write_text(json.dumps({"columns": columns, "rows": [[k] * len(columns) for k in range(3)]}))
    page.write(path, animate.of_file(table, None))
    shown = opened(browser, path)
    assert shown.value("window.hit === undefined")
    assert hostile[:-1] in shown.value("document.getElementById('labels').textContent")
    assert shown.value("document.images.length") == 1


def test_without_webgl_there_is_a_still_and_a_sentence(pendulum: pathlib.Path) -> None:
    running = started(NO_WEBGL)
    try:
        shown = opened(running, pendulum)
        assert shown.value("animation.webgl") is False
        assert shown.value("document.getElementById('lost').hidden") is False
        assert shown.value("document.querySelectorAll('#poster circle').length") == 2
        shown.value("animation.seek(5)")
        assert "=" in shown.value("document.querySelector('#legend button').textContent")
    finally:
        running.close()
