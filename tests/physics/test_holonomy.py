"""Witnesses of nonholonomy: amounts against closed forms, paths against the rows, and no false witness."""

import itertools
import json
import math
import subprocess
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

import lagcli
from lagcli import progress
from lagcli.analysis.holonomy import controlled_paths, local_system, witness, witness_search
from lagcli.api import cache
from lagcli.cli.commands import check_command as telling
from lagcli.start import initial
from tests.helpers import in_process, reference_models

ROOT = Path(__file__).resolve().parents[2]
SYSTEMS = reference_models.systems()


def model_text(
    coordinates: str, rows: dict[str, str], holonomic: dict[str, str] | None = None, more: str = ""
) -> str:
    """A model with unit inertia; `coordinates` as "x y ph=0.3"."""
    starts = [word.partition("=") for word in coordinates.split()]
    lines = ["lagcli: 1", "coordinates:"]
    lines += [f"  {name}: {{value: {value or 0}}}" for name, _, value in starts]
    lines += ["lagrangian: " + " + ".join(f"rate({name})**2/2" for name, *_ in starts), more]
    if holonomic:
        lines += ["holonomic:", *(f"  {name}: {law}" for name, law in holonomic.items())]
    return "\n".join([*lines, "differential:", *(f"  {name}: {law}" for name, law in rows.items())])


def of_reference(name: str) -> str:
    system = SYSTEMS[name]
    rows = {}
    for i, form in enumerate(system["forms"], 1):
        terms = [
            f"({a})*{'dt' if q == 't' else f'd({q})'}"
            for a, q in zip(form, system["coords"], strict=True)
            if a != "0"
        ]
        rows[f"n{i}"] = " + ".join(terms)
    return model_text(" ".join(q for q in system["coords"] if q != "t"), rows)


def found(text: str, row: str, limit: float = 60.0) -> witness.Witness | None:
    ready = cache.compiled(lagcli.loads(text))
    return witness_search.find(ready.system, ready.numeric, row, progress.after(limit))


def verified(text: str, row: str, limit: float = 60.0) -> witness.Witness:
    """A witness, whose path is checked here against the rows by differences between its points."""
    result = found(text, row, limit)
    assert result is not None
    ready = cache.compiled(lagcli.loads(text))
    state = initial.declared(ready.system)
    names = ready.system.model.coordinate_names
    p = result.along(result.coordinate)
    for path in result.paths:
        q = np.repeat(result.configuration[None], len(path.points), axis=0)
        q[:, [names.index(name) for name in result.names[:-1]]] = path.points[:, :-1]
        t = path.points[:, -1]
        for before, after, since, until in zip(q, q[1:], t, t[1:], strict=False):
            B, b = (
                np.array(x)
                for x in ready.numeric.rows((since + until) / 2, (before + after) / 2, state.v, state.p)
            )
            step, wait = after - before, until - since
            size = np.linalg.norm(step) + wait
            # The midpoint rule is wrong by the third power of the step.
            assert np.abs(B @ step + b.ravel() * wait).max() <= 2 * size**3 + 1e-12
    ends = [path.points[-1] for path in result.paths] + [result.base]
    for name in result.back:
        i = result.along(name)
        assert ends[0][i] == pytest.approx(ends[1][i], abs=1e-9)
    assert ends[0][p] - ends[1][p] == pytest.approx(result.amount, abs=1e-12)
    assert abs(result.amount) > 1e6 * result.error
    assert result.row_residual < 1e-12
    assert result.surface_residual < 1e-10
    assert sorted([*result.back, *result.follow, result.coordinate, "t"]) == sorted(result.names)
    return result


def area(path: witness.Path, i: int, j: int) -> float:
    """The integral of y dx over a polygon."""
    x, y = path.corners[:, i], path.corners[:, j]
    return float(np.sum((y[1:] + y[:-1]) / 2 * np.diff(x)))


def test_the_contact_form_moves_by_the_area_of_the_rectangle() -> None:
    result = verified(of_reference("pfaff_contact"), "n1")
    assert result.coordinate == "z"
    assert result.free
    assert len(result.paths[0].corners) == 5
    assert result.amount == pytest.approx(area(result.paths[0], 0, 1), abs=1e-13)
    assert abs(result.amount) == pytest.approx(1, abs=1e-12)


def test_the_knife_edge_moves_by_the_difference_of_tangents() -> None:
    result = verified(of_reference("pfaff_knife_edge"), "n1")
    corners = result.paths[0].corners
    x, y, ph = (corners[:, result.along(name)] for name in ("x", "y", "ph"))
    by_hand = sum(math.tan(a) * dx for a, dx in zip(ph, np.diff(x), strict=False))
    assert result.coordinate == "y"
    assert result.amount == pytest.approx(by_hand, abs=1e-12)
    assert y[-1] - y[0] == pytest.approx(result.amount, abs=1e-13)


def test_martinet_leaves_the_special_start() -> None:
    result = verified(model_text("x y z", {"n": "d(z) - y**2*d(x)"}), "n")
    assert result.coordinate == "z"
    assert not result.is_shifted
    assert abs(result.amount) == pytest.approx(1, abs=1e-12)


@pytest.mark.parametrize("row", ["n1", "n2"])
def test_the_rolling_disk_parks_beside_its_start(row: str) -> None:
    result = verified(of_reference("pfaff_rolling_disk_upright"), row)
    assert result.coordinate == {"n1": "x", "n2": "y"}[row]
    corners = result.paths[0].corners
    heading, rolled = corners[:, result.along("ph")], corners[:, result.along("th")]
    along = {"n1": np.cos, "n2": np.sin}[row](heading[:-1]) @ np.diff(rolled)
    assert result.amount == pytest.approx(along, abs=1e-12)


@pytest.mark.parametrize(
    ("name", "rows"),
    [
        ("pfaff_engel", "n1 n2"),
        ("pfaff_car", "n1 n2"),
        ("pfaff_unicycle_1_trailer", "n1 n2"),
        ("pfaff_ball_plane_spin", "n1 n2"),
        ("pfaff_axle_two_wheels", "n1 n2"),
        ("pfaff_joint_pair_3", "n1 n2"),
    ],
)
def test_every_nonholonomic_row_of_the_reference_has_one(name: str, rows: str) -> None:
    for row in rows.split():
        verified(of_reference(name), row)


def test_the_joint_integral_ties_coordinates_that_move_together() -> None:
    result = verified(of_reference("pfaff_joint_pair_3"), "n1")
    assert {result.coordinate, *result.follow} == {"z", "w"}


def test_only_time_obstructs() -> None:
    result = verified(of_reference("pfaff_rheonomic_affine"), "n1")
    assert result.is_timed
    assert result.coordinate == "x"
    moving, rest = result.paths
    assert moving.points[-1, -1] == rest.points[-1, -1] > moving.points[0, -1]
    assert result.amount == pytest.approx(area(moving, 2, 1), abs=1e-12)
    assert (np.diff(moving.points[:, -1]) > 0).all()


def test_a_pursuit_of_a_moving_target_ends_elsewhere() -> None:
    text = model_text("x y=1", {"aim": "(t - x)*d(y) + y*d(x) = 0"})
    assert verified(text, "aim").is_timed


def test_a_knife_edge_on_a_sphere_stays_on_it() -> None:
    more = "particles: {a: {mass: 1, position: [0.6, 0, 0.8]}}"
    text = model_text("psi", {"n": "sin(psi)*d(a.x) - cos(psi)*d(a.y)"}, {"ball": "norm(a) = 1"}, more)
    result = verified(text, "n")
    ends = result.paths[0].corners[[0, -1]]
    place = [result.along(f"a.{axis}") for axis in "xyz"]
    assert np.linalg.norm(ends[:, place], axis=1) == pytest.approx([1, 1], abs=1e-10)
    assert "psi" in result.back
    assert result.coordinate in ("a.x", "a.y")


def test_parameters_enter() -> None:
    rows = {
        "ahead": "d(x) - R/2*cos(th)*(d(al) + d(be))",
        "aside": "d(y) - R/2*sin(th)*(d(al) + d(be))",
        "turn": "2*b*d(th) + R*(d(al) - d(be))",
    }
    text = model_text("x y th al be", rows, more="parameters: {R: 0.3, b: 0.5}")
    half = verified(text, "aside")
    full = verified(text.replace("R: 0.3", "R: 0.6"), "aside")
    assert half.amount != pytest.approx(full.amount, rel=1e-3)


def test_two_trailers() -> None:
    rows = {
        "car": "sin(t0)*d(x) - cos(t0)*d(y)",
        "one": "d(t1) - sin(t0 - t1)*(cos(t0)*d(x) + sin(t0)*d(y))",
        "two": "d(t2) - cos(t0 - t1)*sin(t1 - t2)*(cos(t0)*d(x) + sin(t0)*d(y))",
    }
    verified(model_text("x y t0 t1 t2", rows), "car")


@pytest.mark.parametrize("row", ["rear", "front", "trailer"])
def test_the_car_with_a_trailer_parks(row: str) -> None:
    result = verified((ROOT / "models" / "car-with-trailer.yaml").read_text(encoding="utf-8"), row, limit=20)
    assert result.free
    assert abs(result.amount) == pytest.approx(0.5, abs=1e-9)


def test_a_straight_chain_is_bent_to_show_the_knife_edge_of_its_first_bead() -> None:
    text = (ROOT / "models" / "chain.yaml").read_text(encoding="utf-8")
    text = text.replace(
        "particles:", "coordinates: {psi: {value: 0.3}}\nlagrangian: rate(psi)**2/2\nparticles:", 1
    )
    edge = "differential:\n  edge: sin(psi)*d(p[1].x) - cos(psi)*d(p[1].y)\noutputs:"
    result = verified(text.replace("outputs:", edge, 1), "edge", limit=20)
    assert result.is_bent
    assert result.coordinate in ("p[1].x", "p[1].y")
    assert "psi" in result.back


def test_lengths_may_be_small_beside_angles() -> None:
    """A knife edge at the end of two links of 1 mm."""
    more = "particles:\n  a: {mass: 1, position: [0.001, 0, 0]}\n  b: {mass: 1, position: [0.001, 0.001, 0]}"
    ties = {"one": "norm(a) = 0.001", "two": "distance(a, b) = 0.001"}
    result = verified(model_text("psi=0.4", {"n": "sin(psi)*d(b.x) - cos(psi)*d(b.y)"}, ties, more), "n")
    assert abs(result.amount) < 0.01


def test_a_bead_of_a_chain_is_moved_with_its_neighbours_alone() -> None:
    """What is far from the row rests, so that the search does not grow with the system."""
    text = (ROOT / "models" / "chain.yaml").read_text(encoding="utf-8")
    ready = cache.compiled(lagcli.loads(text))
    state = initial.declared(ready.system)
    found = local_system.around(ready.system, ready.numeric, state, 1)
    assert found[0].k <= 6
    assert all(a.k < b.k for a, b in itertools.pairwise(found))


@pytest.mark.parametrize(
    ("text", "row"),
    [
        (of_reference("pfaff_exact_product").replace("{value: 0}", "{value: 1}"), "n1"),
        (of_reference("pfaff_factor_sneddon").replace("{value: 0}", "{value: 1}"), "n1"),
        (of_reference("pfaff_axle_two_wheels"), "n3"),
        (of_reference("pfaff_joint_pair_1"), "n1"),
        (of_reference("pfaff_rheonomic_int"), "n1"),
        (model_text("x=1 z=1 w", {"n": "d(w) - z*d(x)"}, {"curve": "z = x**2"}), "n"),
        (model_text("x=1 y th", {"n": "x*d(y) - y*d(x) - (x**2 + y**2)*d(th)"}), "n"),
    ],
)
def test_an_integrable_row_has_none(text: str, row: str) -> None:
    assert found(text, row, limit=4) is None


def test_the_orbit_has_the_dimension_that_can_be_reached() -> None:
    for name, system in SYSTEMS.items():
        if "t" in system["coords"]:
            continue
        text = of_reference(name).replace("{value: 0}", "{value: 0.7}")
        ready = cache.compiled(lagcli.loads(text))
        part = local_system.around(ready.system, ready.numeric, initial.declared(ready.system), 0)[-1]
        here = controlled_paths.through(part, part.start, 0.3, timed=False)
        assert here is not None
        if part.k == len(system["coords"]):
            assert here.tangent.shape[1] == system["accessible_dim"], name


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    return in_process.completed(*arguments, folder=ROOT)


def test_the_command_tells_and_draws_it(tmp_path: Path) -> None:
    figure = tmp_path / "loop.png"
    done = run("check", "models/knife-edge.yaml", "--witness", "edge", "--plot", str(figure))
    assert done.returncode == 0, done.stderr
    assert "phi from 0 to pi/4" in done.stdout
    assert "moves y by -1" in done.stdout
    assert matplotlib.image.imread(figure).shape[0] > 400
    assert list(tmp_path.iterdir()) == [figure]


def test_json_holds_it() -> None:
    done = run("check", "models/knife-edge.yaml", "--witness", "edge", "--json")
    shown = json.loads(done.stdout)["witness"]
    assert shown["row"] == "edge"
    assert shown["coordinate"] == "y"
    assert abs(shown["amount"] + 1) < 1e-12
    assert len(shown["loop"]["points"][0]) == len(shown["loop"]["coordinates"])


@pytest.mark.parametrize("ending", ["svg", "pdf"])
def test_timed_paths_are_drawn(ending: str, tmp_path: Path) -> None:
    model = tmp_path / "model.yaml"
    model.write_text(of_reference("pfaff_rheonomic_affine"), encoding="utf-8")
    figure = tmp_path / f"paths.{ending}"
    done = run("check", str(model), "--witness", "n1", "--plot", str(figure), "--json")
    assert done.returncode == 0, done.stderr
    assert len(json.loads(done.stdout)["witness"]["paths"]) == 2
    assert figure.stat().st_size > 1000


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (["--plot", "a.png"], 2, "--witness"),
        (["--witness", "edgy"], 2, "edge"),
        (["--witness", "edge", "--plot", "a.txt"], 2, "unknown format"),
        (["--witness", "edge", "--plot", "no/such/folder/a.png"], 74, "cannot write"),
        (["models/contact-form.yaml", "--witness", "edge"], 2, "one MODEL"),
    ],
)
def test_wrong_wishes_are_refused(arguments: list[str], code: int, said: str) -> None:
    done = run("check", "models/knife-edge.yaml", *arguments)
    assert done.returncode == code
    assert said in done.stderr
    assert not done.stdout


def test_an_integrable_row_is_refused_with_its_integral(tmp_path: Path) -> None:
    model = tmp_path / "model.yaml"
    model.write_text(model_text("x=1 y=1 z=1", {"n": "y*z*d(x) + x*z*d(y) + x*y*d(z)"}), encoding="utf-8")
    done = run("check", str(model), "--witness", "n", "--json")
    assert done.returncode == 1
    assert "x*y*z = const" in done.stderr
    assert json.loads(done.stdout)["witness"] is None


def test_numbers_a_person_would_write() -> None:
    assert [telling.number(x) for x in (0.5, -math.pi / 4, 3 * math.pi / 2, 1e-14, 2, 1 / 3)] == [
        "0.5", "-pi/4", "3*pi/2", "0", "2", "0.3333333333",
    ]  # fmt: skip
