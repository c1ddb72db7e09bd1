"""The numbers that decide how something is drawn, each from both sides: the outcome differs."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import lagcli
from lagcli.api import cache
from lagcli.model.model import Units
from lagcli.output.animation import links, nets, quadratic, row_pictures, scene
from lagcli.output.animation.links import PointTable
from lagcli.output.animation.quadratic import PicturedRow, Quadratic
from lagcli.output.animation.row_pictures import RowPictures, SingleParticleRow
from lagcli.output.animation.scene import Viewpoint
from lagcli.output.figures import chart, chart_table, compose, panels
from lagcli.output.tables.provenance import TableFacts
from lagcli.running import table_columns
from lagcli.start import initial

MODEL = """lagcli: 1
particles: {a: {mass: 1, position: [1, 0, 0]}, b: {mass: 1, position: [0, 0, 0]}}
holonomic: {row: a.z = 0}
inequality: {stop: a.x - b.x >= 1}
forces: {weight: {to: [a, b], force: [0, 0, -9.81]}}
"""
Z = np.array([0.0, 0.0, 1.0])
FACE = Viewpoint(Z, np.array([0.0, 1.0, 0.0]), np.zeros(3), 1.0, True)


def pictured(form: Quadratic, kind: str = "holonomic") -> PicturedRow:
    model = lagcli.loads(MODEL)
    law = model.holonomic[0] if kind == "holonomic" else model.inequality[0]
    return PicturedRow("row", form, law, 0)


def numbers(**values: float) -> dict[int, np.float64]:
    """Coefficients by components: x, y, z of the first particle, u, v, w of the second."""
    return {"xyzuvw".index(name): np.float64(value) for name, value in values.items()}


@pytest.mark.parametrize(("change", "count"), [(3e-13, 1), (3e-12, 3)])
def test_less_than_rounding_is_no_motion(change: float, count: int) -> None:
    assert len(scene.steady(np.array([[1.0], [1.0 + change], [1.0]]))) == count


@pytest.mark.parametrize(("off", "is_flat"), [(3e-7, True), (3e-6, False)])
def test_points_near_a_plane_are_seen_face_on(off: float, is_flat: bool) -> None:
    angle = np.linspace(0, 2 * np.pi, 40)
    track = np.stack([np.cos(angle), off * np.sin(5 * angle), np.sin(angle)], axis=-1)
    assert scene.view([track], None).flat is is_flat


@pytest.mark.parametrize(("change", "count"), [(3e-10, 1), (3e-9, 0)])
def test_a_distance_that_varies_is_no_tie(change: float, count: int) -> None:
    angle = np.linspace(0, 2, 12)
    radius = 1 + change * np.sin(7 * angle)
    samples = np.stack([radius * np.cos(angle), 0 * angle, radius * np.sin(angle)], axis=-1)[:, None]
    assert len(links.ties(samples, np.array([0]))) == count


@pytest.mark.parametrize(("off", "drawn"), [(3e-6, 1), (3e-5, 0)])
def test_a_rod_that_is_off_its_length_is_not_drawn(off: float, drawn: int) -> None:
    points = PointTable(np.array([[[0.0, 0, 0], [0.0, 0, 1 + off]]]))
    square = {(i, i): np.float64(1) for i in range(6)} | {(i, i + 3): np.float64(-2) for i in range(3)}
    row = pictured(Quadratic(np.float64(-1), {}, square))
    found = quadratic.distance(row.form, False)
    assert found is not None
    link = links.of_row(row, found, points, False)
    assert ((link is not None), points.unenforced) == (bool(drawn), 1 - drawn)


@pytest.mark.parametrize(("change", "is_distance"), [(3e-10, True), (3e-9, False)])
def test_squares_with_other_factors_are_no_distance(change: float, is_distance: bool) -> None:
    square = {(0, 0): np.float64(1), (1, 1): np.float64(1), (2, 2): np.float64(1 + change)}
    found = quadratic.distance(Quadratic(np.float64(-1), {}, square), False)
    assert (found is not None) is is_distance


@pytest.mark.parametrize(("change", "count"), [(3e-10, 1), (3e-9, 2)])
def test_planes_that_are_one_are_drawn_once(change: float, count: int) -> None:
    planes = [row_pictures.plane(pictured(Quadratic(np.float64(c), numbers(z=1))), 0) for c in (0.0, -change)]
    assert len(row_pictures.merged([one for one in planes if one is not None], 1.0)) == count


@pytest.mark.parametrize(
    ("kind", "away", "drawn"),
    [("holonomic", 3e-6, 1), ("holonomic", 3e-5, 0), ("inequality", 1.0, 1), ("inequality", 2.0, 0)],
)
def test_a_plane_far_from_its_particle_is_not_drawn(kind: str, away: float, drawn: int) -> None:
    """An equation holds the particle on it; a wall is drawn for what comes near."""
    plane = row_pictures.plane(pictured(Quadratic(linear=numbers(z=1)), kind), 0)
    assert plane is not None
    particles = np.array([[[0, 0, away]], [[1, 0, away]]])
    assert len(row_pictures.polygons([plane], particles, np.array([np.nan]), 1.0)) == drawn


@pytest.mark.parametrize(("off", "is_one"), [(3e-7, True), (3e-6, False)])
def test_two_particles_on_one_line_touch(off: float, is_one: bool) -> None:
    row = pictured(Quadratic(np.float64(-1), numbers(x=1, u=-1)), "inequality")
    found = row_pictures._line_contact(row, np.array([[[1.0, off, 0], [0.0, 0, 0]]]), 1.0)
    assert (found is not None) is is_one


@pytest.mark.parametrize(("slope", "lines"), [(3e-7, 0), (3e-6, 1)])
def test_a_plane_that_is_the_picture_draws_no_line(slope: float, lines: int) -> None:
    """A second plane cuts a line out of the plane of the motion; one that leans by rounding is that plane itself."""

    def lone(normal: np.ndarray) -> SingleParticleRow:
        return SingleParticleRow("row", False, True, False, lambda places: np.asarray(places @ normal))

    found = RowPictures(single={0: [lone(np.array([0, slope, 1.0])), lone(np.array([0, 1.0, 0]))]})
    drawn = row_pictures.curves(lagcli.loads(MODEL), np.zeros(1), np.zeros((1, 1, 3)), FACE, found)
    assert len(drawn) == lines


@pytest.mark.parametrize(("bend", "axis"), [(2e-9, 2), (8e-9, None)])
def test_a_function_is_straight_along_an_axis_to_nine_digits(bend: float, axis: int | None) -> None:
    def function(places: np.ndarray) -> np.ndarray:
        return np.asarray(places[..., 2] + bend * places[..., 2] ** 2)

    assert nets._straight(function, np.zeros((1, 3)), np.array([0.0, 0.0, 1.0]), 1.0) == axis


def test_gradients_lose_as_little_to_rounding_as_to_bends() -> None:
    places = np.linspace(0, 1, 50)[None, :, None] * np.ones(3)
    slopes = nets.gradient(lambda at: np.asarray(1000 + at[..., 0]), places, 1.0)
    assert np.abs(slopes - [1, 0, 0]).max() < 1e-7
    bent = nets.gradient(lambda at: np.asarray(at[..., 0] ** 3), np.zeros((1, 1, 3)), 1.0)
    assert np.abs(bent).max() < 1e-10


@pytest.mark.parametrize(("apart", "left"), [(3e-7, 1), (3e-6, 2)])
def test_heights_that_are_one_are_drawn_once(apart: float, left: int) -> None:
    found = nets._apart(np.array([[[0.0, 0, 0]], [[0, 0, apart]]]), 2, 1.0)
    assert np.isfinite(found[..., 2]).sum() == left


@pytest.mark.parametrize(("second", "shown"), [(3e-13, 1), (3e-12, 2)])
def test_forces_that_are_rounding_have_no_panel(second: float, shown: int) -> None:
    columns = ["t", *(f"R.{name}.{axis}" for name in "ab" for axis in "xyz")]
    rows = np.array([[t, 1.0, 0, 0, second, 0, 0] for t in (0.0, 1.0)])
    assert len(panels.bands(columns, rows, Units("m", "kg", "s"))[-1].panels) == shown


@pytest.mark.parametrize(("ratio", "are_alike"), [(20.0, True), (50.0, False)])
def test_curves_of_like_size_share_axes(ratio: float, are_alike: bool) -> None:
    assert panels.are_of_like_size([1.0, ratio]) is are_alike


@pytest.mark.parametrize(("largest", "is_noted"), [(5e-14, True), (5e-13, False)])
def test_forces_that_may_be_rounding_are_noted(largest: float, is_noted: bool) -> None:
    table = chart_table.of_rows("t.csv", ["t", "lambda.row"], np.array([[0, 0], [1, largest]]), TableFacts())
    (panel,) = compose.chart([table], compose.chosen("lambda.*")).panels
    assert any("may be zero to rounding" in note for note in panel.notes) is is_noted


@pytest.mark.parametrize(("reaction", "is_zero"), [(5e-13, True), (5e-12, False)])
def test_a_reaction_far_below_the_weight_is_zero(reaction: float, is_zero: bool) -> None:
    """Both particles weigh 9.81 N: a force is zero below 1e-13 of the two together, 1.4e-12."""
    ready = cache.compiled(lagcli.loads(MODEL))
    names = ("t", *ready.system.columns)
    floors = table_columns.Floors(ready.system, ready.numeric, initial.declared(ready.system).p, names)
    row = np.zeros((1, len(names)))
    row[0, names.index("R.a.x")] = reaction
    floors.take(row)
    assert bool(floors.zeros()[names.index("R.a.x")]) is is_zero


def test_an_instant_far_from_zero_has_an_axis_around_it() -> None:
    low, high = chart.widened((1e17, 1e17))
    assert 5e4 < 1e17 - low < 5e5
    assert 5e4 < high - 1e17 < 5e5
    assert chart.widened((3.0, 3.0)) == (2.5, 3.5)


def test_the_view_of_a_scene_has_one_rate() -> None:
    """A run of seconds is shown in its own time, a longer one within ten seconds."""
    one = scene.Scene("", np.array([0.0, 5.0]), (), (), np.zeros(0), FACE, units=("s", "N"))
    assert one.rate == 1.0
    assert dataclasses.replace(one, t=np.array([0.0, 50.0])).rate == 5.0
    assert dataclasses.replace(one, t=np.array([0.0, 1.0])).rate == 0.1
