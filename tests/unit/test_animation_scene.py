"""The scene of an animation: what the rows of a model look like, and what is held against its run."""

from __future__ import annotations

import base64
import json
import pathlib
from collections.abc import Callable

import numpy as np
import pytest

import lagcli
from lagcli.api import animate
from lagcli.model.model import Model
from lagcli.output.animation import builder, links, nets, page, quadratic
from lagcli.output.animation.scene import DrawnSurface, Scene

MODELS = pathlib.Path(__file__).resolve().parents[2] / "models"


def scene_of(text: str, **settings: object) -> Scene:
    return animate.as_far(lagcli.loads("lagcli: 1\n" + text), settings)[0]


def gallery(name: str, **settings: object) -> Scene:
    return animate.as_far(MODELS / f"{name}.yaml", settings)[0]


def surface(scene: Scene, kind: str) -> DrawnSurface:
    (found,) = [one for one in scene.surfaces if one.kind == kind]
    return found


FALLING = """
forces:
  weight: {to: all, force: [0, 0, -9.81*m]}
simulation: {duration: 1, samples: 21}
"""


# ---- rods


@pytest.mark.parametrize(
    "row",
    [
        "distance(a, b) = 2",
        "2 = norm(a - b)",
        "dot(a - b, a - b) = 4",
        "(a.x - b.x)**2 + (a.y - b.y)**2 + (a.z - b.z)**2 - 4 = 0",
        "norm(3*a - 3*b)/3 = 2",
        "sqrt(dot(b - a, b - a)) = 2",
        "norm(a - b)**2/2 = 2",
    ],
)
def test_a_distance_is_a_rod_however_it_is_written(row: str) -> None:
    text = (
        "particles: {a: {mass: 1, position: [0, 0, 0]}, b: {mass: 1, position: [2, 0, 0], velocity: [0, 1, 0]}}\n"
        f"holonomic: {{rod: '{row}'}}"
    )
    (link,) = scene_of(text + FALLING).links
    assert link.kind == "rod"
    assert set(link.ends) == {0, 1}
    assert link.length == pytest.approx(2, rel=1e-12)


def test_rods_hang_on_fixed_moving_and_middle_points() -> None:
    text = """
definitions: {pivot: "[sin(t)/10, 0, 1]"}
particles:
  a: {mass: 1, position: [0, 0, 0], velocity: [0.1, 0, 0]}
  b: {mass: 1, position: [0, 1, 0], velocity: [0.1, 0, 0]}
  c: {mass: 1, position: [0, 0.5, -1], velocity: [0.1, 0, 0]}
holonomic:
  hook: distance(a, pivot) = 1
  bar: distance(a, b) = 1
  low: norm((a + b)/2 - c) = 1
"""
    scene = scene_of(text + FALLING)
    assert [link.kind for link in scene.links] == ["rod"] * 3
    for link in scene.links:
        for frame in range(len(scene.t)):
            apart = np.linalg.norm(scene.at(link.ends[0], frame) - scene.at(link.ends[1], frame))
            assert apart == pytest.approx(link.length, rel=1e-8)
    anchor = scene.points[scene.links[0].ends[1]]
    np.testing.assert_allclose(anchor[:, 0], np.sin(scene.t) / 10, atol=1e-15)


def test_a_rope_is_a_string_with_its_length() -> None:
    (link,) = gallery("rope-slack-and-taut").links
    assert (link.kind, link.name, link.length) == ("string", "rope", 1.0)
    assert link.lengths is None


def test_a_rope_that_is_let_out_has_its_length_at_each_instant() -> None:
    text = (
        "particles: {a: {mass: 1, position: [0, 0, -0.5]}}\n"
        "inequality: {rope: 'distance(a, [0, 0, 0]) <= 1 + t/2'}"
    )
    scene = scene_of(text + FALLING)
    (link,) = scene.links
    assert (link.kind, link.length) == ("string", 1.0)
    assert link.lengths == pytest.approx(1 + scene.t / 2, rel=1e-12)
    assert scene.t[-1] > 0
    data, numbers = page.packed(scene)
    (told,) = json.loads(data)["links"]
    first, count = told["lengths"]
    written = np.frombuffer(base64.b64decode(numbers), dtype="<f4")[first : first + count]
    assert written * json.loads(data)["size"] == pytest.approx(1 + scene.t / 2, rel=1e-6)


PULLEYS = """
parameters: {L: 4}
particles:
  a: {mass: 1, position: [-1, 0, -1]}
  b: {mass: 1, position: [1, 0, -1]}
"""


@pytest.mark.parametrize(
    "row",
    [
        "distance(a, [-1, 0, 0]) + distance(b, [1, 0, 0]) = L - 2",
        "L = 2 + norm(b - [1, 0, 0]) + norm(a - [-1, 0, 0])",
        "3*(2 - L) = -3*distance(a, [-1, 0, 0]) - distance(b, [1, 0, 0])*3",
    ],
)
def test_a_string_over_pulleys_is_drawn_from_end_to_end(row: str) -> None:
    scene = scene_of(PULLEYS + f"holonomic: {{string: '{row}'}}" + FALLING)
    assert [link.kind for link in scene.links] == ["string"] * 3
    places = [{tuple(scene.at(end, 0).tolist()) for end in link.ends} for link in scene.links]
    over = {(-1.0, 0.0, 0.0), (1.0, 0.0, 0.0)}
    assert sorted(map(sorted, places)) == sorted(
        map(sorted, [{(-1.0, 0.0, -1.0), (-1.0, 0.0, 0.0)}, {(1.0, 0.0, -1.0), (1.0, 0.0, 0.0)}, over])
    )


def test_a_string_over_particles_has_no_other_parts() -> None:
    rows = "holonomic: {string: 'distance(a, b) + distance(b, [1, 0, 0]) = 3'}"
    scene = scene_of(PULLEYS + rows + FALLING)
    assert [(link.kind, min(link.ends)) for link in scene.links] == [("string", 0), ("string", 1)]


@pytest.mark.parametrize(
    "row",
    [
        "distance(a, [-1, 0, 0]) = distance(b, [1, 0, 0])",
        "distance(a, [-1, 0, 0])*distance(b, [1, 0, 0]) = 1",
        "distance(a, [-1, 0, 0]) + distance(b, [1, 0, 0]) + a.z = 1",
        "distance(a, [-1, 0, 0]) + distance(b, [1, 0, 0])**3 = 2",
    ],
)
def test_what_is_no_sum_of_distances_is_no_string(row: str) -> None:
    assert scene_of(PULLEYS + f"holonomic: {{row: '{row}'}}" + FALLING).links == ()


def test_a_rod_that_a_table_does_not_keep_is_not_drawn_and_that_is_reported(tmp_path: pathlib.Path) -> None:
    table = tmp_path / "run.csv"
    table.write_text("t,a.x,a.y,a.z,a.vx,a.vy,a.vz\n0,1,0,0,0,0,0\n1,1.5,0,0,0,0,0\n")
    model = lagcli.loads(
        "lagcli: 1\nparticles: {a: {mass: 1, position: [1, 0, 0]}}\nholonomic: {rod: norm(a) = 1}"
    )
    scene = animate.of_file(table, model)
    assert scene.links == ()
    assert any("1 rods or strings are not drawn" in note for note in scene.notes)


def test_rigid_bodies_springs_and_families_are_joined() -> None:
    assert len(gallery("rigid-plate", samples=5).links) == 10
    assert {link.kind for link in gallery("spring-triangle", samples=5).links} == {"spring"}
    chain = gallery("chain", samples=3, duration=0.01)
    assert [link.ends for link in chain.links[1:]] == [(k, k + 1) for k in range(99)]


def test_distances_that_coordinates_keep_are_lines() -> None:
    scene = gallery("double-pendulum-angles", samples=11)
    joined = {link.ends for link in scene.links}
    pivot = next(b for a, b in joined if b >= 2)
    assert joined == {(0, 1), (0, pivot)}
    np.testing.assert_allclose(scene.points[pivot], [[0, 0, 0]], atol=1e-12)


def test_kept_distances_are_those_of_all_samples() -> None:
    random = np.random.default_rng(1)
    angle = random.normal(size=12)
    circle = np.stack([3 + np.cos(angle), np.full(12, 2.0), np.sin(angle)], axis=-1)
    loose = random.normal(size=(12, 3))
    (tie,) = links.ties(np.stack([circle, loose], axis=1), np.array([4, 7]))
    assert tie.particle == 4
    np.testing.assert_allclose(tie.other, [3, 2, 0], atol=1e-12)
    assert tie.length == pytest.approx(1)


# ---- surfaces and curves


def on_plane(one: DrawnSurface, place: np.ndarray, frame: int) -> float:
    _u, _v, w, origin = one.frames[min(frame, len(one.frames) - 1)]
    return float((place - origin) @ w / np.linalg.norm(w))


def test_a_ramp_that_moves_is_a_plane_on_which_the_blocks_stay() -> None:
    scene = gallery("moving-ramp-stick")
    one = surface(scene, "plane")
    assert len(one.frames) == len(scene.t)
    for frame in range(len(scene.t)):
        assert on_plane(one, scene.at(0, frame), frame) == pytest.approx(0, abs=1e-9)
        assert on_plane(one, scene.at(1, frame), frame) == pytest.approx(0, abs=1e-9)


def test_a_sphere_has_its_centre_and_radius() -> None:
    one = surface(gallery("triangle-on-sphere", samples=5), "sphere")
    np.testing.assert_allclose(np.linalg.norm(one.frames[0, :3], axis=1), 5)
    np.testing.assert_allclose(one.frames[0, 3], 0, atol=1e-12)


@pytest.mark.parametrize("name", ["sphere", "bowl", "outer_shell"])
def test_the_name_of_a_row_tells_a_sphere_from_a_rod(name: str) -> None:
    text = (
        "particles: {a: {mass: 1, position: [1, 0, 0], velocity: [0, 1, 0]}}\nholonomic: {ROW: norm(a) = 1}"
    )
    assert scene_of(text.replace("ROW", name) + FALLING).links == ()
    (link,) = scene_of(text.replace("ROW", "arm") + FALLING).links
    assert link.kind == "rod"


def test_a_wire_is_hung_on_alone_and_a_circle_in_a_plane() -> None:
    text = "particles: {a: {mass: 1, position: [1, 0, 0]}}\nholonomic: {wire: norm(a) = 1}"
    assert [link.kind for link in scene_of(text + FALLING).links] == ["rod"]
    scene = scene_of(text.replace("= 1}", "= 1, plane: a.y = 0}") + FALLING)
    assert scene.links == ()
    assert surface(scene, "circle").name == "wire"


def test_a_point_that_is_given_leaves_no_curve() -> None:
    text = """
particles: {pin: {mass: 1, position: [1, 0, 0], velocity: [0, 0, 2]}}
holonomic: {motor: "pin = [cos(2*t), 0, sin(2*t)]"}
"""
    scene = scene_of(text + FALLING)
    assert scene.surfaces == ()
    assert scene.notes == ()
    assert gallery("braced-square", samples=3).surfaces == ()
    text = """
particles: {bead: {mass: 1, position: [0, 0, 0], velocity: [1, 0, 0]}}
holonomic: {plane: bead.y = 0, track: bead.z = 0.2*bead.x**3, motor: bead.x = t}
"""
    scene = scene_of(text + FALLING)
    (points,) = surface(scene, "line").corners
    np.testing.assert_allclose(points[:, 2], 0.2 * points[:, 0] ** 3, atol=1e-7)
    assert surface(scene, "plane").name == "motor"


def test_a_slanting_cylinder_has_its_axis_and_radius() -> None:
    one = surface(gallery("water-slide", samples=11), "cylinder")
    u, v, w, _ = one.frames[0]
    assert np.linalg.norm(u) == pytest.approx(1.5)
    assert np.linalg.norm(v) == pytest.approx(1.5)
    axis = w / np.linalg.norm(w)
    assert abs(axis @ [np.cos(np.pi / 12), 0, -np.sin(np.pi / 12)]) == pytest.approx(1)


def test_an_ellipsoid_has_its_three_axes() -> None:
    text = """
particles: {a: {mass: 1, position: [2, 0, 0], velocity: [0, 1, 1]}}
holonomic: {egg: a.x**2/4 + a.y**2 + a.z**2/9 = 1}
"""
    one = surface(scene_of(text + FALLING), "sphere")
    assert sorted(np.linalg.norm(one.frames[0, :3], axis=1)) == pytest.approx([1, 2, 3])


def test_the_walls_of_a_box_meet_in_its_corners() -> None:
    scene = gallery("particle-in-a-box", samples=21)
    corners = {
        tuple((np.round(one.frames[0, 3] + one.corners @ one.frames[0, :3], 9) + 0.0)[k])
        for one in scene.surfaces
        for k in range(4)
    }
    assert [one.kind for one in scene.surfaces] == ["plane"] * 6
    assert corners == {(x, y, z) for x in (0.0, 1.0) for y in (0.0, 1.2) for z in (0.0, 0.8)}


def test_one_plane_of_many_rows_is_drawn_once_and_hard_spheres_lie_on_it() -> None:
    scene = gallery("sphere-pile", samples=3)
    assert [one.name for one in scene.surfaces] == ["floor[1]", "left[1]", "right[1]"]
    np.testing.assert_allclose(scene.radii, 0.05)
    floor = scene.surfaces[0].frames[0]
    assert floor[3, 2] == pytest.approx(0, abs=1e-12)  # D/2 below the least height of the centres


def test_a_sphere_and_a_plane_that_turns_are_a_circle_that_turns() -> None:
    scene = gallery("bead-on-rotating-hoop-cartesian", samples=21)
    one = surface(scene, "circle")
    assert len(one.frames) == 21
    for frame in range(21):
        u, _v, w, origin = one.frames[frame]
        off = scene.at(0, frame) - origin
        assert np.linalg.norm(off) == pytest.approx(np.linalg.norm(u), rel=1e-8)
        assert off @ w == pytest.approx(0, abs=1e-8)


def test_two_rows_that_are_not_simple_leave_a_curve() -> None:
    text = """
particles: {bead: {mass: 1, position: [1, 0, 0]}}
holonomic:
  across: bead.x = cos(bead.z/0.2)
  aside: bead.y = sin(bead.z/0.2)
"""
    scene = scene_of(text + FALLING)
    (points,) = surface(scene, "line").corners
    assert len(points) > 100
    np.testing.assert_allclose(points[:, 0], np.cos(points[:, 2] / 0.2), atol=1e-6)
    np.testing.assert_allclose(points[:, 1], np.sin(points[:, 2] / 0.2), atol=1e-6)


def test_the_wall_of_a_stadium_is_a_closed_line_in_the_plane_of_the_motion() -> None:
    (points,) = surface(gallery("stadium", samples=51), "line").corners
    np.testing.assert_allclose(points[0], points[-1])
    off = np.hypot(np.maximum(np.abs(points[:, 0]) - 0.5, 0), points[:, 2])
    np.testing.assert_allclose(off, 1, atol=1e-6)


@pytest.mark.parametrize(
    ("row", "off"),
    [
        ("a.z = a.x**2 + a.y**2", lambda p: p[:, 2] - p[:, 0] ** 2 - p[:, 1] ** 2),
        ("a.z = 1 + sin(a.x - 1) + a.y/2", lambda p: p[:, 2] - 1 - np.sin(p[:, 0] - 1) - p[:, 1] / 2),
    ],
)
def test_a_surface_that_is_not_simple_is_a_net_on_it(
    row: str, off: Callable[[np.ndarray], np.ndarray]
) -> None:
    text = f"particles: {{a: {{mass: 1, position: [1, 0, 1], velocity: [0, 1, VZ]}}}}\nholonomic: {{ground: {row}}}"
    scene = scene_of(text.replace("VZ", "0.5" if "sin" in row else "0") + FALLING)
    (nodes,) = surface(scene, "net").corners
    corners = nets.triangles(nodes)
    assert len(corners) > 600
    assert len(corners) % 3 == 0
    np.testing.assert_allclose(off(corners), 0, atol=1e-7)


@pytest.mark.parametrize(
    ("row", "place", "velocity"),
    [
        ("a.x**2 + a.y**2 = a.z**2", "[1, 0, 1]", "[0, 2, 0]"),
        ("a.x**2 + a.y**2 - a.z**2 = 1", "[1, 0, 0]", "[0, 1, 1]"),
        ("(norm([a.x, a.y, 0]) - 2)**2 + a.z**2 = 0.25", "[2.5, 0, 0]", "[0, 2, 1]"),
    ],
)
def test_a_surface_that_bends_back_is_drawn_all_along_the_motion(row: str, place: str, velocity: str) -> None:
    text = (
        f"particles: {{a: {{mass: 1, position: {place}, velocity: {velocity}}}}}\nholonomic: {{s: '{row}'}}"
    )
    scene = scene_of(text + FALLING.replace("duration: 1,", "duration: 2,"))
    assert len(scene.surfaces) > 1
    assert {one.kind for one in scene.surfaces} == {"net"}
    nodes = np.concatenate([one.corners_at(0) for one in scene.surfaces])
    nodes = nodes[np.isfinite(nodes).all(axis=1)]
    assert len(np.unique(nodes.round(6), axis=0)) == len(nodes)
    apart = np.linalg.norm(scene.points[0][:, None] - nodes, axis=-1).min(axis=1)
    assert np.quantile(apart, 0.8) < 4 * scene.view.size / nets.NODES  # two squares of the net


def test_a_curve_that_two_moving_rows_leave_moves_whole() -> None:
    text = """
parameters: {w: 1}
particles: {bead: {mass: 1, position: [1, 0, 1], velocity: [0, 1, 0]}}
holonomic:
  turning: bead.y*cos(w*t) = bead.x*sin(w*t)
  bowl: bead.z = bead.x**2 + bead.y**2
"""
    scene = scene_of(text + FALLING)
    points = surface(scene, "line").corners
    assert points.shape[::2] == (21, 3)
    x, y, z = np.moveaxis(points, -1, 0)
    t = scene.t[:, None]
    np.testing.assert_allclose(z, x**2 + y**2, atol=2e-2)  # between points there are straight pieces
    np.testing.assert_allclose(y * np.cos(t), x * np.sin(t), atol=1e-6)
    # Both arms, up to where the picture ends, at every instant.
    along = x * np.cos(t) + y * np.sin(t)
    assert along.min(axis=1).max() < -0.9
    assert along.max(axis=1).min() > 0.9
    assert not [one for one in scene.surfaces if one.kind != "line"]
    assert not any("not drawn" in note for note in scene.notes)


@pytest.mark.parametrize("row", ["a.z = 0.1*sin(3*a.x - 2*t)", "a.z >= 0.1*sin(3*a.x - 2*t)"])
def test_a_surface_that_moves_is_a_net_that_moves(row: str) -> None:
    kind = "inequality" if ">=" in row else "holonomic"
    text = f"""
particles: {{a: {{mass: 1, position: [0, 0.3, 0], velocity: [0.3, 0.1, {"2" if ">=" in row else "-0.11"}]}}}}
{kind}: {{wave: {row}}}
"""
    scene = scene_of(text + FALLING)
    one = surface(scene, "net")
    nodes = one.corners
    assert len(nodes) == 21
    assert one.one_sided == (">=" in row)
    off = nodes[..., 2] - 0.1 * np.sin(3 * nodes[..., 0] - 2 * scene.t[:, None])
    assert np.isfinite(off).mean() > 0.9
    np.testing.assert_allclose(off[np.isfinite(off)], 0, atol=1e-8)


def test_a_wavy_wall_that_moves_is_a_line_in_the_plane_of_the_motion() -> None:
    text = """
particles: {a: {mass: 1, position: [0, 0, 0], velocity: [0.3, 0, -0.11]}}
holonomic: {plane: a.y = 0, track: a.z = 0.1*sin(3*a.x - 2*t)}
"""
    scene = scene_of(text + FALLING)
    points = surface(scene, "line").corners
    off = points[..., 2] - 0.1 * np.sin(3 * points[..., 0] - 2 * scene.t[:, None])
    np.testing.assert_allclose(off, 0, atol=1e-3)
    np.testing.assert_allclose(points[..., 1], 0, atol=1e-9)


def test_a_lever_is_joined_through_its_pivot() -> None:
    text = """
definitions: {pivot: "[0, 0, sin(t)/10]"}
particles:
  a: {mass: 2, position: [-1, 0, 0], velocity: [0, 0, 0.15]}
  b: {mass: 0.9, position: [2, 0, 0], velocity: [0, 0, 0.1]}
holonomic: {lever: 2*a + b = 3*pivot}
simulation: {duration: 1, samples: 21, assemble: true}
"""
    scene = scene_of(text)
    (first, second) = (link.ends for link in scene.links)
    assert (first[0], second[0]) == (0, 1)
    assert first[1] == second[1]
    np.testing.assert_allclose(scene.points[first[1]][:, 2], np.sin(scene.t) / 10, atol=1e-12)
    assert not any("not drawn" in note for note in scene.notes)


def test_particles_beside_and_between_others_are_joined_with_them() -> None:
    text = """
particles:
  a: {mass: 1, position: [0, 0, 0]}
  b: {mass: 1, position: [2, 0, 0], velocity: [0, 1, 0]}
  c: {mass: 1, position: [1, 0, 0], velocity: [0, 0.5, 0]}
  d: {mass: 1, position: [1, 0, 1], velocity: [0, 0.5, 0]}
  e: {mass: 1, position: [3, 0, 1]}
holonomic:
  middle: c = (a + b)/2
  beside: d - c = [0, 0, 1]
  sum: a + b + c + e = [6, 0, 1 + t*0]
"""
    scene = scene_of(text + "simulation: {duration: 1, samples: 5, assemble: true}")
    assert sorted(link.ends for link in scene.links) == [(2, 0), (2, 1), (2, 3)]
    assert "kept, and not drawn: sum.x, sum.y, sum.z" in scene.notes


def test_rows_that_are_not_drawn_are_named() -> None:
    text = """
coordinates: {th: {value: 0, rate: 1}, ph: {value: 0, rate: 1}}
particles: {a: {mass: 1, position: "[cos(th), sin(th), ph]"}}
holonomic: {motor: th = t}
differential: {screw: d(ph) = d(th)}
"""
    scene = scene_of(text + "simulation: {duration: 1, samples: 5}")
    assert "kept, and not drawn: motor, screw" in scene.notes
    many = """
particles: {"p[i]": {for: "i = 1..12", mass: 1, position: "[i, 0, 0]"}}
holonomic: {"pair[i]": {for: "i = 1..11", equation: "p[i].x*p[i+1].y = 0"}}
"""
    notes = scene_of(many + "simulation: {duration: 1, samples: 3}").notes
    assert f"kept, and not drawn: {', '.join(f'pair[{k}]' for k in range(1, 9))} and 3 others" in notes
    assert "kept, and not drawn: roll_x, roll_y" in gallery("rolling-disk", samples=3).notes


def test_few_shapes_move_and_the_others_are_named() -> None:
    text = """
particles: {"p[i]": {for: "i = 1..8", mass: 1, position: "[0, i, 0]", velocity: "[0.1, 0, 0]"}}
holonomic: {"wave[i]": {for: "i = 1..8", equation: "p[i].z = 0.1*sin(p[i].x*t)"}}
"""
    scene = scene_of(text + "simulation: {duration: 1, samples: 5}")
    assert [one.name for one in scene.surfaces] == [f"wave[{k}]" for k in range(1, 7)]
    assert "kept, and not drawn: wave[7], wave[8]" in scene.notes


@pytest.mark.parametrize(
    "row", ["a.z = t*a.x*a.y*a.z", "sin(a.x) = a.z", "abs(a.x) = 1", "norm(a) = a.x + 1", "a.x*a.y*a.z = 1"]
)
def test_what_is_not_simple_is_not_taken_for_it(row: str) -> None:
    model = lagcli.loads(
        f"lagcli: 1\nparticles: {{a: {{mass: 1, position: [1, 1, 1]}}}}\nholonomic: {{row: {row}}}"
    )
    (found,) = quadratic.rows(model, np.linspace(0, 1, 3))
    assert quadratic.distance(found.form, False) is None


# ---- forces, view, sizes


@pytest.mark.parametrize(
    "name", ["double-pendulum", "double-pendulum-angles", "moving-ramp-stick", "spring-triangle"]
)
def test_r_is_that_of_the_table_and_m_a_is_f_and_r(name: str) -> None:
    model = lagcli.load(MODELS / f"{name}.yaml")
    run = lagcli.simulate(model, samples=4001)
    table = dict(run)
    F = animate.forces(model, table)
    assert F is not None
    masses = np.concatenate([np.ravel(p.mass_values) for p in model.particles])
    for k, particle in enumerate(model.particle_names):
        v = np.stack([run[f"{particle}.v{axis}"] for axis in "xyz"], axis=1)
        a = np.gradient(v, run.t, axis=0)
        R = run.reaction(particle)
        size = np.abs(F[:, k]).max() + np.abs(R).max()
        np.testing.assert_allclose(masses[k] * a[2:-2], (F[:, k] + R)[2:-2], atol=2e-3 * size)
    scene = animate.of_run(model, table)
    for k, particle in enumerate(model.particle_names):
        if scene.R:
            drawn = np.broadcast_to(scene.R[k], (len(scene.t), 3))
            wanted = np.stack([np.interp(scene.t, run.t, part) for part in run.reaction(particle).T], axis=1)
            np.testing.assert_allclose(drawn, wanted, atol=1e-9 * max(1.0, np.abs(wanted).max()))


@pytest.mark.parametrize("plane", ["xy", "yz", "xz"])
def test_planar_motion_is_seen_face_on_and_up_is_against_the_weight(plane: str) -> None:
    first, second = plane
    position = {"x": "0", "y": "0", "z": "0"} | {second: "-1"}
    velocity = {"x": "0", "y": "0", "z": "0"} | {first: "1"}
    force = {"x": "0", "y": "0", "z": "0"} | {second: "-9.81*m"}
    text = f"""
particles: {{a: {{mass: 1, position: [{", ".join(position.values())}], velocity: [{", ".join(velocity.values())}]}}}}
forces: {{weight: {{to: all, force: [{", ".join(force.values())}]}}}}
holonomic: {{rod: norm(a) = 1}}
simulation: {{duration: 1, samples: 21}}
"""
    view = scene_of(text).view
    assert view.flat
    assert view.up["xyz".index(second)] == pytest.approx(1)
    assert abs(view.towards["xyz".index(first)]) < 1e-9
    right = np.cross(view.up, view.towards)
    assert right["xyz".index(first)] == pytest.approx(1)


def test_masses_give_sizes_and_rods_bound_them() -> None:
    scene = gallery("double-pendulum", samples=5)
    assert scene.radii[0] > scene.radii[1] > 0
    chain = gallery("chain", samples=3, duration=0.01)
    assert chain.radii.max() < 0.01 / 2


# ---- coordinates, tables, modes


def test_coordinates_without_particles_are_positions_or_beads() -> None:
    disk = gallery("rolling-disk", samples=21)
    assert disk.names == ("(x, y)",)
    assert disk.points[0].shape == (21, 3)
    assert disk.R[0].shape == (21, 3)
    hoop = gallery("hoop-on-ramp", samples=21)
    assert hoop.names == ("x", "phi")
    assert [one.kind for one in hoop.surfaces] == ["line", "line"]
    assert hoop.points[0][:, 2].min() == 0
    assert hoop.points[0][:, 2].max() == 1


def test_a_model_of_too_many_particles_is_refused() -> None:
    text = "lagcli: 1\nparticles:\n  p[i]: {for: 'i = 1..5001', mass: 1, position: '[i, 0, 0]'}"
    with pytest.raises(builder.NothingToShow, match="5001 particles"):
        animate.as_far(lagcli.loads(text), {})[0]


def shapes_of(name: str) -> tuple[Model, Scene]:
    model = lagcli.load(MODELS / f"{name}.yaml")
    return model, animate.of_modes(model, lagcli.modes(model))


def test_modes_swing_along_their_shapes() -> None:
    model, scene = shapes_of("double-pendulum")
    found = lagcli.modes(model)
    assert len(scene.modes) == 2
    for mode, shape in zip(scene.modes, found.shapes, strict=True):
        away = (mode.points - mode.points[0])[:, :2].reshape(len(scene.t), -1)
        quarter = away[(len(scene.t) - 1) // 4]
        np.testing.assert_allclose(
            quarter / np.abs(quarter).max(), shape.real / np.abs(shape).max(), atol=1e-9
        )
        np.testing.assert_allclose(away[-1], 0, atol=1e-12)


def test_modes_of_coordinates_move_the_particles_on_their_circles() -> None:
    _, scene = shapes_of("double-pendulum-angles")
    for mode in scene.modes:
        np.testing.assert_allclose(np.linalg.norm(mode.points[:, 0], axis=1), 1, rtol=1e-12)
        assert np.ptp(mode.points[:, 0, 0]) > 0.01
        assert mode.swings
