"""`lagcli animate` and `modes --animate`: files, refusals, exit codes."""

from __future__ import annotations

import dataclasses
import itertools
import json
import pathlib
import shutil
from typing import Any

import numpy as np
import pytest
from matplotlib import animation
from PIL import Image

import lagcli
from lagcli.api import animate
from lagcli.output.animation import film, nets
from lagcli.output.files import interrupts
from tests.helpers import in_process

MODELS = pathlib.Path(__file__).resolve().parents[2] / "models"
PENDULUM = MODELS / "pendulum.yaml"


def data_of(page: pathlib.Path) -> dict[str, Any]:
    text = page.read_text(encoding="utf-8")
    return dict(json.loads(text.partition('id="scene">')[2].partition("</script>")[0]))


def told(*arguments: object) -> str:
    """What is said on stderr of a command line that is refused."""
    out, err, code = in_process.run("animate", *arguments)
    assert (out, code) == ("", 2)
    return err


def test_a_model_is_simulated_with_its_settings_and_changes(tmp_path: pathlib.Path) -> None:
    page = tmp_path / "page.html"
    out, err, code = in_process.run(
        "animate", PENDULUM, "-o", page, "--duration", 2, "--samples", 51, "--set", "L=2"
    )
    assert (out, code) == ("", 0)
    assert "51 instants" in err
    data = data_of(page)
    assert data["t"][1] == 51
    assert data["links"][0]["length"] * data["size"] == pytest.approx(2)
    assert [curve["name"] for curve in data["curves"]] == ["rod", "plane"]


def test_the_page_goes_to_standard_output_without_a_file() -> None:
    out, err, code = in_process.run("animate", PENDULUM, "--samples", 5)
    assert code == 0
    assert out.startswith("<!doctype html>")
    assert out == in_process.run("animate", PENDULUM, "--samples", 5, "-o", "-")[0]
    assert err == ""


def test_the_same_run_gives_the_same_page(tmp_path: pathlib.Path) -> None:
    pages = [tmp_path / f"{k}.html" for k in range(2)]
    for page in pages:
        in_process.run("animate", PENDULUM, "--samples", 21, "-o", page, "-q")
    assert pages[0].read_bytes() == pages[1].read_bytes()


@pytest.mark.parametrize("ending", ["csv", "tsv", "json", "npz", "parquet"])
def test_a_table_with_its_model_gives_the_page_of_the_model(tmp_path: pathlib.Path, ending: str) -> None:
    table, one, two = tmp_path / f"run.{ending}", tmp_path / "one.html", tmp_path / "two.html"
    in_process.run("simulate", PENDULUM, "--samples", 21, "-q", "-o", table)
    assert in_process.run("animate", table, "--model", PENDULUM, "-o", one, "-q")[2] == 0
    assert in_process.run("animate", PENDULUM, "--samples", 21, "-o", two, "-q")[2] == 0
    assert one.read_bytes() == two.read_bytes()


def test_a_table_alone_has_places_and_reactions_but_no_rods(tmp_path: pathlib.Path) -> None:
    table, page = tmp_path / "run.csv", tmp_path / "page.html"
    in_process.run("simulate", PENDULUM, "--samples", 21, "-q", "-o", table)
    assert in_process.run("animate", table, "-o", page)[2] == 0
    data = data_of(page)
    assert (data["links"], data["F"], len(data["R"]), data["count"]) == ([], [], 1, 1)


def test_tables_that_cannot_be_shown_are_refused(tmp_path: pathlib.Path) -> None:
    table = tmp_path / "run.csv"
    table.write_text("t,a.x,a.y,a.z,a.vx,lambda.other\n0,0,0,0,0,1\n")
    assert "it is of another model" in told(table, "--model", PENDULUM, "-o", tmp_path / "p.html")
    table.write_text("t,q\n0,0\n")
    assert "give its model with --model" in told(table, "-o", tmp_path / "p.html")
    assert "no column `a.x`" in told(table, "--model", PENDULUM, "-o", tmp_path / "p.html")
    table.write_text("t,a.x,a.y,a.z,a.vx\n0,0,0,0,0\n1,nan,0,0,0\n")
    assert "`a.x` holds what is no finite number" in told(table, "-o", tmp_path / "p.html")
    table.write_text("t,a.x,a.y,a.z,a.vx\n1,0,0,0,0\n0,0,0,0,0\n")
    assert "times do not increase" in told(table, "-o", tmp_path / "p.html")
    table.write_text("t,a.x,a.y,a.z,a.vx\n")
    assert "has no rows" in told(table, "-o", tmp_path / "p.html")
    assert not (tmp_path / "p.html").exists()


def test_wrong_command_lines_are_refused(tmp_path: pathlib.Path) -> None:
    table = tmp_path / "run.csv"
    table.write_text("t,a.x,a.y,a.z,a.vx\n0,0,0,0,0\n")
    page = tmp_path / "page.html"
    assert "there is no file" in told(tmp_path / "none.yaml", "-o", page)
    assert "known endings: .html, .gif, .mp4" in told(PENDULUM, "-o", tmp_path / "page.txt")
    assert "--model is of a table" in told(PENDULUM, "--model", PENDULUM, "-o", page)
    assert "--duration is of a run" in told(table, "--duration", 1, "-o", page)
    assert "--from is of a run" in told(table, "--from", table, "-o", page)
    assert "--set is of a model" in told(table, "--set", "m=1", "-o", page)
    assert "samples" in told(PENDULUM, "--samples", 1, "-o", page)
    model = tmp_path / "model.html"
    shutil.copy(PENDULUM, model)
    assert "MODEL" in told(model, "-o", model)


def test_a_folder_that_is_not_there_is_reported_before_the_run(tmp_path: pathlib.Path) -> None:
    _, err, code = in_process.run("animate", PENDULUM, "-o", tmp_path / "none" / "page.html")
    assert code == 74
    assert "cannot write" in err


def test_a_run_that_stops_leaves_the_file_and_writes_a_partial_page(tmp_path: pathlib.Path) -> None:
    model, page = tmp_path / "stops.yaml", tmp_path / "page.html"
    model.write_text(
        "lagcli: 1\nparticles: {a: {mass: 1, position: [1, 0, 0], velocity: [-1, 0, 0]}}\n"
        "forces: {pull: {to: a, force: '-r/norm(r)**4'}}\nsimulation: {duration: 5, samples: 501}\n"
    )
    page.write_text("as it was")
    _, err, code = in_process.run("animate", model, "-o", page)
    assert code == 3
    assert page.read_text() == "as it was"
    partial = tmp_path / "page.html.partial"
    assert data_of(partial)["count"] == 1
    assert "page.html.partial" in err


@pytest.mark.parametrize("pictures", [0, 2])
def test_a_film_that_is_interrupted_is_none_and_no_bug(
    tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch, pictures: int
) -> None:
    grab, taken = animation.PillowWriter.grab_frame, []

    def interrupted(self: animation.PillowWriter) -> None:
        taken.append(1)
        if len(taken) > pictures:
            raise interrupts.Interrupted(1)
        grab(self)

    monkeypatch.setattr(animation.PillowWriter, "grab_frame", interrupted)
    _, err, code = in_process.run("animate", PENDULUM, "-o", tmp_path / "film.gif")
    assert (code, "bug" in err) == (129, False)
    assert list(tmp_path.iterdir()) == []


def test_a_gif_has_its_pictures(tmp_path: pathlib.Path) -> None:
    path = tmp_path / "film.gif"
    _, err, code = in_process.run(
        "animate", MODELS / "rope-slack-and-taut.yaml", "--duration", 0.2, "--samples", 6, "-o", path
    )
    assert code == 0, err
    with Image.open(path) as picture:
        assert picture.size == (960, 540)
        assert picture.n_frames > 1  # type: ignore[attr-defined]
        assert len(set(picture.convert("L").tobytes())) > 2


def test_mp4_without_ffmpeg_is_refused_before_the_run(
    tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(film.animation.FFMpegWriter, "isAvailable", classmethod(lambda cls: False))
    assert "needs the program ffmpeg" in told(PENDULUM, "-o", tmp_path / "film.mp4")


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="there is no ffmpeg")
def test_mp4_is_written_where_ffmpeg_is(tmp_path: pathlib.Path) -> None:
    path = tmp_path / "film.mp4"
    assert in_process.run("animate", PENDULUM, "--duration", 0.1, "--samples", 4, "-o", path)[2] == 0
    assert path.read_bytes()[4:8] == b"ftyp"


def test_a_film_has_trails_of_few_particles_that_move() -> None:
    scene = animate.as_far(MODELS / "double-pendulum.yaml", {"samples": 51})[0]
    drawing = film._Drawing(scene)
    assert len(drawing._trails) == 2
    drawing.show(30)
    for path, drawn in drawing._trails:
        pieces = drawn.get_segments()
        assert np.array_equal(pieces[-1][-1], path[30])
        assert any(np.array_equal(pieces[0][0], path[first]) for first in (20, 21))  # a fifth, rounded
        assert all(np.array_equal(one[-1], other[0]) for one, other in itertools.pairwise(pieces))
    drawing.show(0)
    assert all(len(np.unique(piece, axis=0)) == 1 for piece in drawing._trails[0][1].get_segments())
    many = dataclasses.replace(
        scene, names=("p",) * 25, points=scene.points[:1] * 25, radii=np.ones(25), R=(), F=()
    )
    assert film._Drawing(many)._trails == []


def test_a_film_draws_the_lines_of_a_net_that_moves() -> None:
    text = """
lagcli: 1
particles: {a: {mass: 1, position: [0, 0.3, 0], velocity: [0.3, 0.1, -0.11]}}
holonomic: {wave: a.z = 0.1*sin(3*a.x - 2*t)}
simulation: {duration: 1, samples: 5}
"""
    scene = animate.as_far(lagcli.loads(text), {})[0]
    (net,) = scene.surfaces
    for frame in (0, 3):
        places = nets.strings(net.corners_at(frame))
        side = nets.MOVING_NODES
        assert len(places) == 2 * side * (side + 1)
        off = places[:, 2] - 0.1 * np.sin(3 * places[:, 0] - 2 * scene.t[frame])
        assert np.nanmax(np.abs(off)) < 1e-8
        steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
        assert np.nanmax(steps) < 0.4  # neighbours: no line runs across
    drawn = film._Drawing(scene)
    drawn.show(0)
    first = drawn._rims[0].get_xydata().copy()
    drawn.show(3)
    assert np.nanmax(np.abs(drawn._rims[0].get_xydata() - first)) > 1


def test_modes_of_what_cannot_move_are_reported_so(tmp_path: pathlib.Path) -> None:
    model = tmp_path / "still.yaml"
    model.write_text(
        "lagcli: 1\nparticles: {a: {mass: 1, position: [0, 0, 0]}}\nholonomic: {here: 'a = [0, 0, 0]'}\n",
        encoding="utf-8",
    )
    _, err, code = in_process.run("modes", model, "--animate", tmp_path / "m.html")
    assert code == 2
    assert "nothing can swing: the rows leave the model no freedom to move" in err


def test_modes_are_written_as_a_page(tmp_path: pathlib.Path) -> None:
    path = tmp_path / "modes.html"
    out, _, code = in_process.run("modes", MODELS / "double-pendulum-angles.yaml", "--animate", path)
    assert (out, code) == ("", 0)
    data = data_of(path)
    assert [mode["name"] for mode in data["modes"]] == ["1: ω = 2.65623/s", "2: ω = 5.22297/s"]
    _, err, code = in_process.run("modes", PENDULUM, "--animate", tmp_path / "modes.gif")
    assert code == 2
    assert ".html" in err


@pytest.mark.parametrize(
    "name", ["bicycle", "contact-form", "solar-system", "four-legged-table", "bricard", "cloth"]
)
def test_models_of_other_kinds_have_a_page(name: str) -> None:
    _, err, code = in_process.run(
        "animate", MODELS / f"{name}.yaml", "--samples", 3, "--duration", 0.01, "-q"
    )
    assert code == 0, err


STUCK = """
lagcli: 1
particles: {a: {mass: 2, position: [-0.67, -0.13, 0], velocity: [0, -0.78, 0.81]}}
forces: {weight: {to: all, force: "[0, 0, -9.81*m]"}}
holonomic: {ring: "a.x**2 + a.z**2 = 0.4489"}
differential: {row: "d(a.x) = 0"}
simulation: {duration: 1, samples: 5}
"""


@pytest.mark.parametrize("command", ["animate", "report", "plot"])
def test_a_run_that_stops_before_its_first_row_is_said_to(command: str, tmp_path: pathlib.Path) -> None:
    model = tmp_path / "stuck.yaml"
    model.write_text(STUCK, encoding="utf-8")
    target = tmp_path / ("figure.svg" if command == "plot" else "page.html")
    out, err, code = in_process.run(command, model, "-o", target)
    assert (out, code) == ("", 3)
    assert "stopped at t = 0 (after row 0 of 5)" in " ".join(err.split())
    assert "bug" not in err
    assert "there is no row to" in err
    assert not target.exists()


def test_a_run_before_its_first_row_leaves_the_figure_as_it_was(tmp_path: pathlib.Path) -> None:
    """Of `plot`, on the terminal too, and of `simulate --plot`."""
    model, target = tmp_path / "stuck.yaml", tmp_path / "figure.svg"
    model.write_text(STUCK, encoding="utf-8")
    target.write_text("as it was", encoding="utf-8")
    for arguments in (
        ("plot", model, "-o", target),
        ("plot", model, "--show"),
        ("simulate", model, "--plot", target),
    ):
        out, err, code = in_process.run(*arguments)
        assert (out, code) == ("", 3)
        assert "stopped at t = 0 (after row 0 of 5)" in " ".join(err.split())
        assert err.count("there is no row to draw") == 1
        assert target.read_text(encoding="utf-8") == "as it was"


def test_a_run_without_a_row_is_left_beside_one_that_has_rows(tmp_path: pathlib.Path) -> None:
    stuck, moves, target = tmp_path / "stuck.yaml", tmp_path / "moves.yaml", tmp_path / "figure.svg"
    stuck.write_text(STUCK, encoding="utf-8")
    moves.write_text(STUCK.replace('differential: {row: "d(a.x) = 0"}\n', ""), encoding="utf-8")
    _, err, code = in_process.run("plot", stuck, moves, "--y", "a.x", "-o", target)
    assert code == 3, err
    assert "stopped at t = 0 (after row 0 of 5)" in " ".join(err.split())
    assert "<svg" in target.read_text(encoding="utf-8")
