"""Displacements beside closed contacts: free, one-sided and blocked directions, and allowed ones over dt (D.8)."""

import json
import math

import numpy as np
import pytest
from scipy import optimize

import lagcli
from tests.helpers.in_process import command  # noqa: F401 - a fixture

ONE = "lagcli: 1\nparticles: {a: {mass: 2, position: [0, 0, 0]}}\nforces: {w: {to: all, force: [0, 0, -9.81*m]}}\n"


def beside(inequality, head=ONE, **options):
    text = head + "inequality:\n" + "".join(f"  {name}: {law}\n" for name, law in inequality.items())
    return lagcli.displacements(lagcli.loads(text), **options)


def of(found, kind):
    """Displacements (k, n) of length one, and the names beside them."""
    chosen = [one for one in found.contacts.directions if one.kind == kind]
    units = [one.displacement / np.linalg.norm(one.displacement) for one in chosen]
    return np.array(units).reshape(-1, len(found.q)), [one.contacts for one in chosen]


def rows(found):
    """G (k, n) and g_t (k,) of the closed contacts."""
    closed = [one for one in found.contacts.contacts if one.state == "closed"]
    n = len(found.q)
    return np.array([one.gradient for one in closed]).reshape(-1, n), np.array([one.rate for one in closed])


def holds(found, B=None):
    """The cone of the directions is that of B dq = 0, G dq >= 0: all in it, and all of it is made of them."""
    G, _ = rows(found)
    B = np.zeros((0, G.shape[1])) if B is None else B
    free, one_sided, blocked = (of(found, kind)[0] for kind in ("free", "one-sided", "blocked"))
    assert np.abs(G @ free.T).max(initial=0.0) < 1e-12
    assert (G @ one_sided.T).min(initial=0.0) > -1e-12
    assert all((G @ u).min() < -1e-6 for u in blocked)
    assert np.abs(B @ np.vstack([free, one_sided, blocked]).T).max(initial=0.0) < 1e-12
    rng = np.random.default_rng(3)
    kernel = np.linalg.svd(np.vstack([B, np.zeros((1, G.shape[1]))]))[2][
        np.linalg.matrix_rank(B) if len(B) else 0 :
    ]
    generators = np.vstack([free, -free, one_sided]).T
    inside = 0
    for _ in range(40):
        # The vertex of a box in the cone that goes the farthest along a random direction.
        aim = kernel @ rng.standard_normal(G.shape[1])
        box = optimize.linprog(-aim, A_ub=-G @ kernel.T, b_ub=np.zeros(len(G)), bounds=(-1, 1))
        u = kernel.T @ box.x
        inside += np.linalg.norm(u) > 0.1
        assert optimize.nnls(generators, u)[1] < 1e-9 if generators.size else np.linalg.norm(u) < 1e-9
    return inside


def test_a_flat_floor_leaves_two_ways_free_and_one_way_up():
    found = beside({"floor": "a.z >= 0"})
    free, _ = of(found, "free")
    assert np.linalg.matrix_rank(free) == 2 == len(free)
    assert not free[:, 2].any()
    up, opened = of(found, "one-sided")
    down, blocking = of(found, "blocked")
    np.testing.assert_allclose(up, [[0, 0, 1]], atol=1e-15)
    np.testing.assert_allclose(down, [[0, 0, -1]], atol=1e-15)
    assert opened == blocking == [("floor",)]
    assert found.bases.dimension == 3
    assert holds(found)
    # Of length one in the mass metric.
    assert [one.displacement[2] for one in found.contacts.directions[2:]] == pytest.approx(
        [1 / math.sqrt(2), -1 / math.sqrt(2)], rel=1e-14
    )
    np.testing.assert_array_equal(found.contacts.allowed, np.zeros(3))


def test_a_ramp_blocks_along_its_normal_in_the_metric_of_masses():
    """Block and wedge: q = (X, s), M is not diagonal; the ray is M^-1 G^T."""
    head = (
        "lagcli: 1\ncoordinates: {X: {value: 0}, u: {value: 0}, w: {value: 0}}\n"
        "particles:\n  wedge: {mass: 3, position: [X, 0, 0]}\n  block: {mass: 1, position: [X + u, 0, w]}\n"
    )
    found = beside({"face": "w >= 0.5*u"}, head)
    M = np.array([[4.0, 1, 0], [1, 1, 0], [0, 0, 1]])
    ray = np.linalg.solve(M, [0, -0.5, 1])
    np.testing.assert_allclose(of(found, "one-sided")[0], [ray / np.linalg.norm(ray)], atol=1e-14)
    assert len(of(found, "free")[0]) == 2
    assert holds(found)


def test_over_a_ramp_that_moves_the_allowed_displacement_is_across_it():
    found = beside({"ramp": "a.z - a.x >= 0.5*t"})
    np.testing.assert_allclose(found.contacts.allowed, [-0.25, 0, 0.25], atol=1e-15)
    np.testing.assert_allclose(found.allowed_r[0], [-0.25, 0, 0.25], atol=1e-15)
    G, rate = rows(found)
    np.testing.assert_array_equal(rate, [-0.5])
    np.testing.assert_allclose(G @ found.contacts.allowed + rate, 0.0, atol=1e-15)
    assert found.bases.allowed.any() == False  # noqa: E712 - the rows alone drive nothing
    leaving = beside({"ramp": "a.z - a.x >= -0.5*t"})
    np.testing.assert_array_equal(leaving.contacts.allowed, np.zeros(3))


def test_a_corner_of_two_walls_has_a_ray_along_each():
    found = beside({"left": "a.x + 0.3*a.z >= 0", "right": "a.z >= 0.1*a.x"})
    rays, opened = of(found, "one-sided")
    assert opened == [("left",), ("right",)]
    # Each ray slides along the other wall.
    np.testing.assert_allclose(np.abs(rays[:, 2] / rays[:, 0]), [0.1, 1 / 0.3], rtol=1e-13)
    assert len(of(found, "free")[0]) == 1
    assert holds(found)


def test_walls_on_both_sides_block_both_ways():
    found = beside({"left": "a.x >= 0", "right": "a.x <= 0", "floor": "a.z >= 0"})
    blocked, by = of(found, "blocked")
    told = {(tuple(np.round(u, 12) + 0.0), names) for u, names in zip(blocked, by, strict=True)}
    assert told == {((1, 0, 0), ("right",)), ((-1, 0, 0), ("left",)), ((0, 0, -1), ("floor",))}
    assert len(of(found, "free")[0]) == len(of(found, "one-sided")[0]) == 1
    assert holds(found)


def test_a_wedge_that_closes_blocks_what_its_walls_leave_each_other():
    """Three walls of a plane that hold a point from all sides: nothing is left but the way along them."""
    walls = {
        f"w{k}": f"{math.cos(a):.17g}*a.x + ({math.sin(a):.17g})*a.z >= 0"
        for k, a in enumerate((0.1, 2.0, 4.0))
    }
    found = beside(walls)
    assert of(found, "one-sided")[0].size == 0
    blocked, by = of(found, "blocked")
    assert len(blocked) == 4
    assert np.linalg.matrix_rank(blocked) == 2
    G, _ = rows(found)
    assert all(
        {f"w{k}" for k in np.flatnonzero(G @ u < -1e-9)} == set(names)
        for u, names in zip(blocked, by, strict=True)
    )
    np.testing.assert_allclose(np.abs(of(found, "free")[0]), [[0, 1, 0]], atol=1e-14)
    # Held by three and a fourth across: that one stays one-sided.
    more = beside({**walls, "end": "a.y <= 0"})
    assert of(more, "one-sided")[1] == [("end",)]


def test_twin_walls_open_together():
    found = beside(
        {"one": "a.z >= 0", "two": "3*a.z >= 0", "under": "a.z + 0.2*a.x >= 0", "side": "a.x >= 0"}
    )
    rays, opened = of(found, "one-sided")
    assert len(rays) == 2
    assert sorted(map(set, opened), key=len) == [{"under", "side"}, {"one", "two", "under"}]
    assert holds(found)


def test_a_pyramid_of_six_walls_has_six_edges():
    walls = {f"w{k}": f"a.z >= {math.cos(k)}*a.x + ({math.sin(k)})*a.y" for k in range(6)}
    found = beside(walls)
    rays, opened = of(found, "one-sided")
    assert len(rays) == 6
    assert all(len(names) == 4 for names in opened)  # along an edge two of six stay closed
    assert not len(of(found, "free")[0])
    assert holds(found) > 5


ROPE = """
lagcli: 1
particles: {a: {mass: 1, position: [3, 0, -4]}, b: {mass: 4, position: [0, 0, 0]}}
"""


def test_a_taut_rope_is_blocked_outwards():
    found = beside({"rope": "distance(a, b) <= 5"}, ROPE)
    blocked, by = of(found, "blocked")
    assert by == [("rope",)]
    along = np.array([3, 0, -4]) / 5
    pull = np.concatenate([along, -along / 4])
    np.testing.assert_allclose(blocked[0], pull / np.linalg.norm(pull), atol=1e-14)
    assert len(of(found, "free")[0]) == 5
    assert holds(found)


def test_rows_may_hold_a_contact_closed_or_turn_its_ray():
    B = np.array([[0.0, 0, 1]])
    held = beside({"floor": "a.z >= 0", "wall": "a.x + a.z >= 0"}, ONE + "holonomic: {track: a.z = 0}\n")
    assert of(held, "one-sided")[1] == [("wall",)]
    np.testing.assert_allclose(of(held, "one-sided")[0], [[1, 0, 0]], atol=1e-14)
    assert len(of(held, "free")[0]) == 1
    np.testing.assert_array_equal(held.contacts.allowed, np.zeros(3))
    assert holds(held, B)
    # A lift leads the particle on: with the floor below, or into it.
    up = beside({"floor": "a.z >= 0"}, ONE + "holonomic: {lift: a.z = 2*t}\n")
    np.testing.assert_allclose(up.contacts.allowed, [0, 0, 2], atol=1e-15)
    down = beside({"floor": "a.z >= 0"}, ONE + "holonomic: {lift: a.z = -2*t}\n")
    assert down.contacts.allowed is None is down.allowed_r
    assert down.contacts.notes == (
        "no displacement over dt > 0 is allowed: the rows would have `floor` violated",
    )


def test_rolling_rows_and_generalized_coordinates():
    head = (
        "lagcli: 1\ncoordinates: {x: {value: 0}, y: {value: 0}, phi: {value: 0.5}}\n"
        "lagrangian: (rate(x)**2 + rate(y)**2 + 2*rate(phi)**2)/2\n"
        'differential: {blade: "sin(phi)*d(x) - cos(phi)*d(y) = 0"}\n'
    )
    found = beside({"stop": "x >= 0", "turn": "phi <= 0.5"}, head)
    rays, opened = of(found, "one-sided")
    assert opened == [("stop",), ("turn",)]
    np.testing.assert_allclose(rays, [[math.cos(0.5), math.sin(0.5), 0], [0, 0, -1]], atol=1e-14)
    assert found.contacts.as_json(found.components.names)["directions"][0]["columns"] == pytest.approx(
        {"x": math.cos(0.5), "y": math.sin(0.5), "phi": 0}, abs=1e-14
    )
    assert holds(found, np.array([[math.sin(0.5), -math.cos(0.5), 0]]))


def test_each_member_of_a_family_has_its_own_contact():
    head = 'lagcli: 1\nparticles: {"a[i]": {for: "i = 1..120", mass: i, position: [i, 0, 0]}}\n'
    found = beside({"floor[i]": '{for: "i = 1..120", condition: "a[i].z >= 0"}'}, head)
    rays, opened = of(found, "one-sided")
    assert opened == [(f"floor[{i}]",) for i in range(1, 121)]
    np.testing.assert_allclose(rays, np.eye(360)[2::3], atol=1e-14)
    assert len(of(found, "free")[0]) == 240


def test_a_violated_start_and_an_open_contact_are_said():
    head = ONE.replace("position: [0, 0, 0]", "position: [0, 0, -0.25]")
    found = beside({"floor": "a.z >= 0", "far": "a.x >= -5", "wall": "a.y >= 0"}, head)
    assert [(one.name, one.state) for one in found.contacts.contacts] == [
        ("floor", "violated"), ("far", "open"), ("wall", "closed")
    ]  # fmt: skip
    (note,) = found.contacts.notes
    assert note.startswith("the initial positions violate `floor` by 0.25")
    assert of(found, "one-sided")[1] == [("wall",)]
    # A floor that has been left is open at a later time.
    late = beside({"floor": "a.z >= 0"}, ONE.replace("[0, 0, 0]", "[0, 0, 0], velocity: [0, 0, 1]"), at=0.05)
    assert late.contacts.contacts[0].state == "open"
    assert len(of(late, "free")[0]) == 3
    rest = beside({"floor": "a.z >= 0"}, at=0.5)
    assert rest.contacts.contacts[0].state == "closed"


@pytest.mark.parametrize(
    ("law", "why"),
    [
        ("a.z**3 >= 0", "the gradient of `odd` vanishes or has no value"),
        ("a.x**2 + a.z**2 >= 0", "the gradient of `odd` vanishes or has no value"),
        ("sqrt(a.z) >= 0", "the gradient of `odd` vanishes or has no value"),
        ("max(a.x, a.z) >= 0", "the gradient of `odd` jumps"),
    ],
)
def test_a_contact_without_a_gradient_leaves_the_directions_untold(law, why):
    found = beside({"odd": law, "wall": "a.y >= 0"})
    assert found.contacts.directions is None
    assert found.contacts.allowed is None
    assert why in found.contacts.notes[0]
    # Clear of that point it is a contact like others.
    clear = beside({"odd": "max(a.x - 1, a.z) >= 0"})
    assert of(clear, "one-sided")[1] == [("odd",)]


def test_a_piston_that_closes_allows_no_displacement():
    found = beside({"left": "a.x >= t", "right": "a.x <= -t", "floor": "a.z >= 0"})
    assert found.contacts.allowed is None
    assert found.contacts.notes == (
        "no displacement over dt > 0 is allowed: `left`, `right` close on each other",
    )
    # Opening, and moving as one: what is shortest follows.
    assert not beside({"left": "a.x >= -t", "right": "a.x <= t"}).contacts.allowed.any()
    pushed = beside({"left": "a.x >= 3*t", "right": "a.x <= 3*t"}).contacts.allowed
    np.testing.assert_allclose(pushed, [3, 0, 0], atol=1e-14)


@pytest.mark.parametrize("size", [1e-9, 1e9])
def test_units_of_conditions_and_masses_change_no_direction(size):
    head = ONE.replace("mass: 2", f"mass: {2 * size}")
    found = beside(
        {"floor": f"{size}*a.z >= 0", "wall": f"a.x/{size} >= 0", "back": f"-a.x*{size} >= 0"}, head
    )
    assert of(found, "one-sided")[1] == [("floor",)]
    assert sorted(of(found, "blocked")[1]) == [("back",), ("floor",), ("wall",)]


def legs(count):
    """Feet of a rigid plate on a floor: 3 coordinates, as many edges as feet."""
    feet = {f"f{k}": f"z + {math.cos(k)!r}*u + {math.sin(k)!r}*v >= 0" for k in range(count)}
    head = (
        "lagcli: 1\ncoordinates: {z: {}, u: {}, v: {}}\n"
        "lagrangian: (rate(z)**2 + rate(u)**2 + rate(v)**2)/2\n"
    )
    return beside(feet, head)


def test_rays_of_some_thousand_sets_of_contacts_are_listed():
    few = legs(12)
    assert holds(few) > 5
    found = legs(100)  # 4950 pairs
    assert len(of(found, "one-sided")[0]) == 100
    assert found.contacts.notes == ()
    found = legs(250)  # 31125 pairs
    (ray,), (opened,) = of(found, "one-sided")
    assert len(opened) == 250
    np.testing.assert_allclose(ray, [1, 0, 0], atol=0.01)
    assert "not listed" in found.contacts.notes[0]


def test_the_command_prints_and_writes_the_directions(command, tmp_path):  # noqa: F811
    path = tmp_path / "m.yaml"
    path.write_text(ONE + "inequality: {ramp: a.z - a.x >= 0.5*t, far: a.y >= -1}\n", encoding="utf-8")
    answer = json.loads(command("displacements", path, "--json")[0])
    assert [(one["name"], one["state"]) for one in answer["contacts"]] == [
        ("ramp", "closed"),
        ("far", "open"),
    ]
    assert [one["kind"] for one in answer["directions"]] == ["free", "free", "one-sided", "blocked"]
    columns = {"a.x": -0.5, "a.y": 0, "a.z": 0.5}
    assert answer["directions"][2]["columns"] == pytest.approx(columns, abs=1e-15)
    assert answer["allowed"]["displacement"] == pytest.approx([-0.25, 0, 0.25], abs=1e-15)
    out, _, code = command("displacements", path)
    assert code == 0
    assert "-da.x + da.z - 0.5 dt >= 0" in out
    assert {"free", "one-sided", "blocked"} <= set(out.split())
    assert "nothing is driven" not in out
    path.write_text(ONE.replace("[0, 0, 0]", "[0, 0, -1]") + "inequality: {f: a.z >= 0}\n", encoding="utf-8")
    out, err, code = command("displacements", path)
    assert code == 0
    assert "violated" in out
    assert "violate `f`" in err
