"""Numbers that other programs publish, beside ours; those that are off are computed a third time, by other code."""

import functools
import json
import math
import pathlib
from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import lagcli
from lagcli.running.trajectory import Trajectory
from tests.helpers import andrews_mechanism, published_quantities

REFERENCE = pathlib.Path(__file__).parents[1] / "reference"
CASES = json.loads((REFERENCE / "published.json").read_text(encoding="utf-8"))
ROWS = [
    pytest.param(case, row, id=f"{case['id']}, {row['quantity']}") for case in CASES for row in case["rows"]
]
STATED = 3e-10  # relative: eleven digits are stated, the last of them rounded
ROUNDING = 1e-10  # where the true value is zero, of values up to 100

pytestmark = pytest.mark.numeric


@functools.cache
def motion(model: str) -> Trajectory:
    options = next(case.get("options", {}) for case in CASES if case["model"] == model)
    return lagcli.simulate(lagcli.load(published_quantities.path(model)), **options)


@functools.cache
def quantity(name: str) -> float:
    return published_quantities.QUANTITIES[name]()


def ours(case: dict, row: dict) -> float:
    if "by" in row:
        return quantity(row["by"])
    run = motion(case["model"])
    if "event" in row:
        return sum(factor * float(run.events[name][row["event"]]) for name, factor in row["terms"].items())
    values = sum(factor * np.asarray(run[name]) for name, factor in row["terms"].items())
    values = values + row.get("constant", 0.0)
    return float(np.abs(values).max()) if row.get("largest") else float(values[-1])


@pytest.mark.parametrize(("case", "row"), ROWS)
def test_our_number_is_the_one_that_is_printed(case: dict, row: dict) -> None:
    value = ours(case, row)
    if row.get("bound"):  # an error, of which the size is stated
        assert value < 3 * float(row["lagcli"])
    elif row.get("largest"):
        assert value < ROUNDING
        assert float(row["lagcli"]) < ROUNDING
    else:
        assert value == pytest.approx(float(row["lagcli"]), rel=STATED, abs=1e-12)


@pytest.mark.parametrize(("case", "row"), [param for param in ROWS if not param.values[1].get("off")])
def test_a_published_number_is_met_to_its_digits(case: dict, row: dict) -> None:
    """Those of Adams come from runs with tolerances of the size of the digits they are printed with."""
    loose = "ADAMS" in case["source"] or "Distance_Case" in case["source"] or "Adams" in case["source"]
    published = float(row["published"])
    decimals = len(row["published"].partition(".")[2])
    unit = 0.5 * 10.0**-decimals
    bound = (
        2e-5 if loose else max(unit, 1e-10 * abs(published)) + (2e-8 if "extrapolated" in case["id"] else 0.0)
    )
    if row.get("largest"):
        bound = ROUNDING
    if row.get("bound"):
        assert ours(case, row) < published
        return
    assert abs(ours(case, row) - published) <= bound


def solved(rates: Callable[[float, np.ndarray], list[float]], start: list[float], end: float) -> np.ndarray:
    found = solve_ivp(rates, (0.0, end), start, method="DOP853", rtol=1e-12, atol=1e-13)
    assert found.success
    return found.y[:, -1]


def four_bar() -> dict[str, float]:
    """By its one angle, the coupler's end by implicit differentiation of the two lengths."""
    g, pivot = 9.81, np.array([4.0, 0.0])

    def kinematics(angle: float, end: np.ndarray) -> tuple[np.ndarray, ...]:
        first = 2 * np.array([math.sin(angle), math.cos(angle)])
        slope, bend = 2 * np.array([math.cos(angle), -math.sin(angle)]), -first
        rows = np.array([end - first, end - pivot])
        moved = np.linalg.solve(rows, [(end - first) @ slope, 0.0])
        turned = np.linalg.solve(
            rows, [(end - first) @ bend - (moved - slope) @ (moved - slope), -moved @ moved]
        )
        return slope, bend, moved, turned

    def rates(_: float, y: np.ndarray) -> list[float]:
        slope, bend, moved, turned = kinematics(y[0], y[2:])
        inertia = slope @ slope + moved @ moved
        force = -g * (slope[1] + moved[1]) - (slope @ bend + moved @ turned) * y[1] ** 2
        return [y[1], force / inertia, *(moved * y[1])]

    slope, _, moved, _ = kinematics(0.0, np.array([4.0, 5.0]))
    given = np.array([4.0, 0.0, 10.0, 0.0])
    allowed = np.concatenate([slope, moved])
    y = solved(rates, [0.0, given @ allowed / (allowed @ allowed), 4.0, 5.0], 2.0)
    return {"displacement of node 1 in y at t = 2": 2 * math.cos(y[0]) - 2}


def duffing() -> dict[str, float]:
    m, k, d, amplitude, end = 1.6, 4000.0, 4.0, 80.0, 50.0
    pitch = math.sqrt(k / m) / (2 * math.pi)

    def rates(t: float, y: np.ndarray) -> list[float]:
        push = amplitude * math.sin(2 * math.pi * (pitch / end * 0.5 * t) * t)
        return [y[1], (push - 0.1 * k * y[0] - k * y[0] ** 3 - d * y[1]) / m]

    return {"place at t = 50": 0.5 + solved(rates, [0.0, 0.0], end)[0]}


def double_pendulum() -> dict[str, float]:
    """In its two angles from the x axis."""
    length, g = 0.8, 9.81

    def rates(_: float, y: np.ndarray) -> list[float]:
        a, b, da, db = y
        inertia = np.array([[2.0, math.cos(a - b)], [math.cos(a - b), 1.0]])
        force = [
            -math.sin(a - b) * db**2 - 2 * g / length * math.cos(a),
            math.sin(a - b) * da**2 - g / length * math.cos(b),
        ]
        return [da, db, *np.linalg.solve(inertia, force)]

    a = solved(rates, [0.0, 0.0, 0.0, 0.0], 1.0)[0]
    return {"x + y of the upper mass at t = 1": length * (math.cos(a) + math.sin(a))}


def pendulum() -> dict[str, float]:
    y = solved(lambda _, y: [y[1], -9.81 * math.cos(y[0])], [0.0, 0.0], 1.0)
    return {"x at t = 1": math.cos(y[0])}


def spring_and_damper() -> dict[str, float]:
    y = solved(lambda _, y: [y[1], -100 * (y[0] - 1) - y[1]], [1.05, 0.0], 1.0)
    return {"x at t = 1": y[0]}


def double_four_bar() -> dict[str, float]:
    """All cranks turn alike: 3 phi'^2/2 - 7/2 g cos(phi) for two windows."""
    y = solved(lambda _, y: [y[1], 3.5 / 3 * 9.81 * math.sin(y[0])], [0.0, 1.0], 10.0)
    return {"x of B1 at t = 10": math.sin(y[0]), "y": math.cos(y[0])}


def hung_body() -> dict[str, float]:
    """A body of mass 1 that hangs at the distance 2, with the inertia 0.1 across; let go from the level."""
    g, d, inertia = 9.80665, 2.0, 0.1

    def turning(angle: float) -> float:
        return g * d * math.cos(angle) / (d**2 + inertia)

    a, rate = solved(lambda _, y: [y[1], turning(y[0])], [0.0, 0.0], 5.0)
    x, z = d * math.cos(a), -d * math.sin(a)
    # m a - F on the body, and the opposite on the ground.
    along_x = z * turning(a) - x * rate**2
    along_z = -x * turning(a) - z * rate**2 + g
    return {"force on the ground, x, at t = 5": -along_x, "z": -along_z}


def squeezing_mechanism() -> dict[str, float]:
    found = andrews_mechanism.multipliers()
    return {"multiplier 1 at t = 0.03": found[0], "multiplier 6": found[5]}


THIRD = {
    "Andrews' squeezing mechanism, multipliers": squeezing_mechanism,
    "four-bar mechanism": four_bar,
    "Duffing oscillator": duffing,
    "double pendulum": double_pendulum,
    "pendulum on a distance": pendulum,
    "spring and damper": spring_and_damper,
    "double four-bar": double_four_bar,
    "spherical joint": hung_body,
}


@pytest.mark.parametrize(
    "case", [case for case in CASES if any(row.get("off") for row in case["rows"])], ids=lambda c: c["id"]
)
def test_where_a_published_number_is_off_a_third_computation_says_ours(case: dict) -> None:
    third = THIRD[case["id"]]()
    for row in case["rows"]:
        assert row["off"]
        value = ours(case, row)
        assert third[row["quantity"]] == pytest.approx(value, rel=1e-9, abs=1e-9)
        assert abs(float(row["published"]) - value) > 1e-7


def test_what_the_page_says_of_the_duffing_oscillator() -> None:
    """The displacement, without the offset, is off by 4 parts in a hundred."""
    (case,) = (case for case in CASES if case["id"] == "Duffing oscillator")
    (row,) = case["rows"]
    true = ours(case, row) - 0.5
    assert (true - (float(row["published"]) - 0.5)) / true == pytest.approx(0.04, abs=0.005)


def test_two_files_of_adams_tell_different_forces_of_one_motion() -> None:
    first, second = (
        next(c for c in CASES if c["id"] == name) for name in ("spherical joint", "revolute joint")
    )
    assert first["model"] == second["model"]
    for one, other in zip(first["rows"], second["rows"], strict=True):
        theirs = float(other["published"])
        assert abs(float(one["published"]) - theirs) > 30 * abs(ours(second, other) - theirs)


def test_the_four_bar_mechanism_is_refused_as_it_starts() -> None:
    with pytest.raises(lagcli.ModelError):
        lagcli.simulate(lagcli.load(REFERENCE / "peers" / "exudyn_fourbar.yaml"))


def test_the_matrix_of_sympy_has_the_eigenvalues_of_the_bicycle() -> None:
    """That of SymPy e950d31, sympy/physics/mechanics/tests/test_kane3.py, to the digits that its derivation keeps."""
    v = 5.0
    matrix = np.array([
        [0, 0, 1, 0],
        [0, 0, 0, 1],
        [9.48977444677355, -0.891197738059089 * v**2 - 0.571523173729245,
         -0.105522449805691 * v, -0.330515398992311 * v],
        [11.7194768719633, -1.97171508499972 * v**2 + 30.9087533932407,
         3.67680523332152 * v, -3.08486552743311 * v],
    ])  # fmt: skip
    theirs = np.sort_complex(np.linalg.eigvals(matrix))
    model = lagcli.load(published_quantities.path("models/bicycle.yaml"), {"v": v})
    np.testing.assert_allclose(np.sort_complex(lagcli.modes(model).eigenvalues), theirs, rtol=1e-12)


def test_every_model_of_the_folder_belongs_to_a_case() -> None:
    assert {path.name for path in (REFERENCE / "peers").glob("*.yaml")} == {
        case["model"] for case in CASES if not case["model"].startswith("models/")
    }


def test_the_bodies_of_the_gallery_of_peers_are_counted() -> None:
    counts = {"fekete.yaml": 40, "chrono_spherical1.yaml": 3, "iftomm_fourbar.yaml": 1}
    for name, count in counts.items():
        assert lagcli.dof(lagcli.load(REFERENCE / "peers" / name)).configuration_dof == count
