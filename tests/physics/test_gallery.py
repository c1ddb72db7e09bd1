"""The gallery: every model runs and gives its verdicts, its count and its numbers from closed forms."""

import functools
import json
import pathlib
import re

import numpy as np
import pytest

import lagcli
from tests.helpers import recorded_runs, redundant_models

pytestmark = pytest.mark.numeric

HERE = pathlib.Path(__file__).parents[1]
MODELS = HERE.parent / "models"
GALLERY = json.loads((HERE / "gallery.json").read_text(encoding="utf-8"))
INCIDENTS = [(name, i) for name, entry in GALLERY.items() for i in range(len(entry.get("incidents", ())))]
CHECKS = [(name, i) for name, entry in GALLERY.items() for i in range(len(entry["checks"]))]


@functools.cache
def table(name):
    return lagcli.simulate(lagcli.load(MODELS / name))


@functools.cache
def told(name):
    """Columns of the table, incidents, and the names of the rows of their impulses."""
    columns, _, incidents, rows = recorded_runs.run((MODELS / name).read_text(encoding="utf-8"), samples=2)
    return columns, incidents, rows


@functools.cache
def report(name):
    return lagcli.check(lagcli.load(MODELS / name))


def state_columns(name):
    """Indices of the columns of positions and of velocities."""
    columns = table(name).columns
    model = lagcli.load(MODELS / name)
    qs = set(model.generalized_names)
    places = [f"{name}.{axis}" for name in model.particle_names for axis in "xyz"]
    speeds = [f"{name}.v{axis}" for name in model.particle_names for axis in "xyz"]
    return (
        [i for i, c in enumerate(columns) if c in places or c in qs],
        [
            i
            for i, c in enumerate(columns)
            if c in speeds or c.removeprefix("rate(").removesuffix(")") in qs - {c}
        ],
    )


def index_rows():
    """File -> the cells of its row in the index."""
    found = {}
    for line in (MODELS / "README.md").read_text(encoding="utf-8").splitlines():
        match = re.match(r"\| \[([\w-]+)\]\(([\w.-]+)\) \|(.*)\|$", line)
        if match:
            assert match[1] + ".yaml" == match[2]
            assert match[2] not in found, f"{match[2]} is listed twice"
            found[match[2]] = [cell.strip() for cell in match[3].split("|")]
    return found


def test_index_and_data_list_exactly_the_files_that_exist():
    files = {path.name for path in MODELS.glob("*.yaml")}
    assert set(index_rows()) == files
    assert set(GALLERY) == files


@pytest.mark.parametrize("name", GALLERY)
def test_index_states_the_count_of_the_data(name):
    _, _, count, _ = index_rows()[name]
    expected = GALLERY[name]["dof"]
    assert count.startswith("undecided") if expected is None else count == str(expected)


@pytest.mark.parametrize("name", GALLERY)
def test_model_opens_with_what_it_teaches_and_its_source(name):
    text = (MODELS / name).read_text(encoding="utf-8")
    opening = text[: text.index("lagcli: 1")]
    assert all(line.startswith("#") for line in opening.splitlines())
    assert "Teaches:" in opening
    assert "Source:" in opening


@pytest.mark.parametrize("name", GALLERY)
def test_count(name):
    counted = lagcli.dof(lagcli.load(MODELS / name))
    assert counted.configuration_dof == GALLERY[name]["dof"]
    if counted.configuration_dof is None:
        assert counted.reason
        assert counted.proof == "none"


@pytest.mark.parametrize("name", GALLERY)
def test_verdicts_and_consistent_start(name):
    found = {c.verdict.row: c.verdict.kind for c in report(name).constraints}
    expected = GALLERY[name]["verdicts"]
    assert {row: found[row] for row in expected} == expected
    contacts = GALLERY[name].get("contacts", [])
    others = {row: kind for row, kind in found.items() if row not in expected}
    assert all(kind == ("inequality" if row in contacts else "holonomic") for row, kind in others.items())
    assert report(name).initial.consistent


@pytest.mark.parametrize("name", GALLERY)
def test_redundant_rows_and_multipliers_that_are_not_unique(name):
    found = report(name).as_json()["constraints"]
    assert [row["name"] for row in found if row["redundant"]] == GALLERY[name].get("redundant", [])
    shared = set(GALLERY[name].get("shared", []))
    assert {row["name"] for row in found if row["unique"] is False} == shared
    assert set(table(name).stats.indeterminate) == shared


@pytest.mark.parametrize("name", redundant_models.REDUNDANT)
def test_reactions_are_those_of_the_version_without_redundant_rows(name):
    other = lagcli.loads(redundant_models.without(name))
    assert not any(row["redundant"] for row in lagcli.check(other).as_json()["constraints"])
    run, other = table(name), lagcli.simulate(other)
    for column in run.columns:
        if column.startswith("R."):
            scale = max(1.0, np.abs(other[column]).max())
            np.testing.assert_allclose(run[column], other[column], rtol=0, atol=1e-9 * scale)


# Where contacts of a pile are dependent at an instant alone, a run does not go on.
TWICE = [n for n in GALLERY if GALLERY[n]["verdicts"] or "contacts" in GALLERY[n]]


@pytest.mark.parametrize("name", [n for n in TWICE if n != "sphere-pile.yaml"])
def test_reactions_stay_where_every_constraint_is_declared_twice(name):
    once, twice = map(lagcli.loads, redundant_models.twice(name))
    options = {"samples": 6, "duration": min(1.0, once.simulation.duration or 1.0)}
    run, other = lagcli.simulate(once, **options), lagcli.simulate(twice, **options)
    for column in run.columns:
        scale = max(1.0, np.abs(run[column]).max())
        if column.startswith("lambda."):
            continue
        np.testing.assert_allclose(other[column], run[column], rtol=0, atol=1e-9 * scale, err_msg=column)
    twins = [c.removeprefix("lambda.") for c in other.columns if c.startswith("lambda.") and "_twin" in c]
    contacts = {re.sub(r"^(\w+)", r"\1_twin", row) for row in GALLERY[name].get("contacts", ())}
    assert set(other.stats.indeterminate) >= {*twins} - contacts


@pytest.mark.parametrize("name", GALLERY)
def test_runs_to_its_end_on_its_constraints(name):
    run = table(name)
    settings = lagcli.load(MODELS / name).simulation
    ended_by = GALLERY[name].get("ended_by")
    assert run.stats.ended_by == ended_by
    assert ended_by or run.t[-1] == settings.start + settings.duration
    assert np.isfinite(run.rows).all()
    places, speeds = (np.abs(run.rows[:, part]).max(initial=1.0) for part in state_columns(name))
    assert run.stats.position_drift <= 1e-12 * places
    assert run.stats.velocity_drift <= 1e-11 * speeds
    assert run.stats.energy_imbalance <= 1e-8


@pytest.mark.parametrize(
    ("name", "i"), CHECKS, ids=[f"{n}-{GALLERY[n]['checks'][i]['column']}" for n, i in CHECKS]
)
def test_number_from_its_closed_form(name, i):
    check = GALLERY[name]["checks"][i]
    run = table(name)
    (row,) = np.flatnonzero(np.abs(run.t - check["t"]) < 1e-9 * max(1.0, abs(check["t"])))
    assert run[check["column"]][row] == pytest.approx(check["value"], rel=0, abs=check["tolerance"]), check[
        "formula"
    ]


@pytest.mark.parametrize(
    ("name", "i"),
    INCIDENTS,
    ids=["-".join((n, *map(str, list(GALLERY[n]["incidents"][i].values())[:4]))) for n, i in INCIDENTS],
)
def test_incident_from_its_closed_form(name, i):
    check = GALLERY[name]["incidents"][i]
    columns, incidents, rows = told(name)
    found = [each for each in incidents if (each.kind, each.name) == (check["kind"], check["name"])]
    it = found[check["number"] - 1]
    values = dict(zip(columns, [it.t, *it.after], strict=True))
    values |= {f"impulse.{row}": P for row, P in zip(rows, it.impulses.tolist(), strict=True)}
    assert values[check["column"]] == pytest.approx(check["value"], rel=0, abs=check["tolerance"]), check[
        "formula"
    ]


@pytest.mark.parametrize("name", [name for name in GALLERY if "counts" in GALLERY[name]])
def test_number_of_incidents(name):
    _, incidents, _ = told(name)
    for kind, count in GALLERY[name]["counts"].items():
        assert len({each.t for each in incidents if each.kind == kind}) == count


@pytest.mark.parametrize("name", [name for name in GALLERY if "contacts" in GALLERY[name]])
def test_no_contact_pulls_and_none_is_entered(name):
    run = table(name)
    rows = [c.removeprefix("lambda.") for c in run.columns if c.startswith("lambda.")]
    assert rows[-len(GALLERY[name]["contacts"]) :] == GALLERY[name]["contacts"]
    for row in GALLERY[name]["contacts"]:
        assert run[f"lambda.{row}"].min() >= 0.0
    assert run.stats.largest_penetration <= 1e-10
