"""Reference problems: state, multipliers and reactions against trusted numbers, in both forms."""

import functools

import numpy as np
import pytest
import sympy

import lagcli
from tests.helpers import reference_models

pytestmark = pytest.mark.numeric

PROBLEMS = reference_models.problems()
WITH_PARTICLES = [name for name, problem in PROBLEMS.items() if reference_models.components(problem)]
WITH_ROWS = [name for name, problem in PROBLEMS.items() if reference_models.rows(problem)]
CASES = [(name, "coordinates") for name in PROBLEMS] + [(name, "particles") for name in WITH_PARTICLES]

STATE, MULTIPLIER, AGREEMENT, DEFAULT_DIGITS = 1e-8, 1e-7, 1e-10, 1e-8


@functools.cache
def run(name, form, tight):
    problem = PROBLEMS[name]
    write = {"coordinates": reference_models.as_coordinates, "particles": reference_models.as_particles}[form]
    duration, step = reference_models.grid(problem)
    options = {"rtol": 1e-12, "atol": 1e-14} if tight else {}
    return lagcli.simulate(lagcli.loads(write(problem)), duration=duration, output_step=step, **options)


def columns(problem, form):
    """Column of each reference quantity of the state, and of the constraint force on each coordinate."""
    state, force = {}, {}
    for q in problem["coords"]:
        if form == "coordinates":
            state |= {q: q, f"v{q}": f"rate({q})"}
            force[q] = f"R.{q}"
        else:
            place = reference_models.components(problem)[q]
            state |= {q: place, f"v{q}": place.replace(".", ".v")}
            force[q] = f"R.{place}"
    return state, force


def row_at(table, time):
    """The row that stands at a reference time."""
    (found,) = np.flatnonzero(np.abs(table.t - float(time)) < 1e-9)
    return found


def state_error(name, form, tight):
    """Largest error of the state over all reference times, and the largest reference value."""
    problem, table = PROBLEMS[name], run(name, form, tight)
    state, _ = columns(problem, form)
    worst = scale = 0.0
    for point in problem["reference"]:
        i = row_at(table, point["t"])
        for quantity, column in state.items():
            expected = float(point["state"][quantity])
            worst = max(worst, abs(table[column][i] - expected))
            scale = max(scale, abs(expected))
    return worst, scale


@functools.cache
def gradients(name):
    """The rows of B as functions of (t, coordinates), by SymPy."""
    problem = PROBLEMS[name]
    constants = {}
    for parameter, text in problem.get("params", {}).items():
        constants[parameter] = sympy.sympify(text, locals=constants)
    letters = {q: sympy.Symbol(q, real=True) for q in (*problem["coords"], "t")}
    read = functools.partial(sympy.sympify, locals=letters | constants)
    rows = [
        [sympy.diff(read(f), letters[q]) for q in problem["coords"]] for f in problem.get("holonomic", ())
    ]
    rows += [[read(form.get(q, "0")) for q in problem["coords"]] for form in problem.get("pfaffian", ())]
    return sympy.lambdify([letters["t"], *(letters[q] for q in problem["coords"])], sympy.Matrix(rows))


def expected_reaction(name, point):
    """sum lambda_i grad f_i from the reference numbers alone, by coordinate."""
    problem = PROBLEMS[name]
    at = [float(point["state"][q]) for q in problem["coords"]]
    B = np.array(gradients(name)(float(point["t"]), *at), dtype=float)
    return dict(zip(problem["coords"], B.T @ np.array(point["lam"], dtype=float), strict=True))


@pytest.mark.parametrize(("name", "form"), CASES)
def test_state_matches_the_reference(name, form):
    assert state_error(name, form, tight=True)[0] <= STATE


@pytest.mark.parametrize(("name", "form"), [case for case in CASES if case[0] in WITH_ROWS])
def test_multipliers_match_the_reference_in_size_and_sign(name, form):
    problem, table = PROBLEMS[name], run(name, form, True)
    expected = np.array([point["lam"] for point in problem["reference"]], dtype=float)
    rows = [row_at(table, point["t"]) for point in problem["reference"]]
    found = np.array([table[f"lambda.{row}"][rows] for row in reference_models.rows(problem)]).T
    assert np.abs(found - expected).max() <= MULTIPLIER * np.abs(expected).max()


@pytest.mark.parametrize(("name", "form"), [case for case in CASES if case[0] in WITH_ROWS])
def test_reactions_are_the_sum_of_multipliers_times_gradients(name, form):
    problem, table = PROBLEMS[name], run(name, form, True)
    _, force = columns(problem, form)
    expected = [expected_reaction(name, point) for point in problem["reference"]]
    scale = max(abs(value) for reaction in expected for value in reaction.values())
    for point, reaction in zip(problem["reference"], expected, strict=True):
        i = row_at(table, point["t"])
        for q, column in force.items():
            assert table[column][i] == pytest.approx(reaction[q], rel=0, abs=MULTIPLIER * scale), (
                q,
                point["t"],
            )


@pytest.mark.parametrize("name", WITH_PARTICLES)
def test_particles_and_coordinates_agree(name):
    problem = PROBLEMS[name]
    plain, real = run(name, "coordinates", True), run(name, "particles", True)
    places = [columns(problem, form) for form in ("coordinates", "particles")]
    pairs = [(places[0][part][key], places[1][part][key]) for part in (0, 1) for key in places[0][part]]
    pairs += [(f"lambda.{row}", f"lambda.{row}") for row in reference_models.rows(problem)]
    assert np.array_equal(plain.t, real.t)
    for one, other in pairs:
        scale = max(1.0, np.abs(plain[one]).max())
        assert np.abs(plain[one] - real[other]).max() <= AGREEMENT * scale, (one, other)


@pytest.mark.parametrize("name", PROBLEMS)
def test_default_tolerances_give_eight_digits(name):
    form = "particles" if name in WITH_PARTICLES else "coordinates"
    worst, scale = state_error(name, form, tight=False)
    assert worst <= DEFAULT_DIGITS * scale


def test_every_problem_of_the_file_is_tried():
    assert len(PROBLEMS) == 22
    assert len(WITH_PARTICLES) == 16
