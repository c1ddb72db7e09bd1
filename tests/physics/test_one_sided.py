"""One-sided constraints: states, multipliers, instants and impulses against trusted numbers.

The cases of `tests/reference/one_sided.json`, and tables that Siconos publishes for its event-driven examples.
"""

import functools
import itertools
import json
import pathlib

import numpy as np
import pytest

from tests.helpers import reference_models
from tests.helpers.recorded_runs import run

pytestmark = pytest.mark.numeric

DATA = pathlib.Path(__file__).parents[1] / "reference" / "one_sided.json"
CASES = {case["id"]: case for case in json.loads(DATA.read_text(encoding="utf-8"))["cases"]}
MOST_ROWS = 2000


def options(case):
    """Keywords in the place of the options of the command line."""
    words = iter(case["args"])
    return {name.removeprefix("--"): float(value) for name, value in zip(words, words, strict=True)}


@functools.cache
def motion(name):
    """Columns, rows and incidents of a run up to the last row of a case."""
    case = CASES[name]
    duration, step = reference_models.grid({"reference": case["rows"]})
    grid = {"samples": 2} if duration / step > MOST_ROWS else {"output_step": step}
    return run(case["model"], duration=duration, **grid, **options(case))


def off(got, want):
    return abs(got - float(want)) / max(1.0, abs(float(want)))


def instants(incidents, names, kinds=("impact", "release")):
    """One entry an instant: t, kind, names, and impulses by row."""
    told = [each for each in incidents if each.kind in kinds]
    for (t, kind), group in itertools.groupby(told, key=lambda each: (each.t, each.kind)):
        same = list(group)
        yield t, kind, {e.name for e in same}, dict(zip(names, same[0].impulses.tolist(), strict=True))


@pytest.mark.parametrize("name", CASES)
def test_states_multipliers_and_reactions_are_those_of_the_reference(name):
    case = CASES[name]
    for point in case["rows"]:
        columns, table, _, _ = motion(name)
        if len(table) == 2:
            columns, table, _, _ = run(case["model"], duration=float(point["t"]), samples=2, **options(case))
        line = table[np.abs(table[:, 0] - float(point["t"])).argmin()]
        assert line[0] == pytest.approx(float(point["t"]), abs=1e-12)
        found = dict(zip(columns, line, strict=True))
        worst = {column: off(found[column], want) for column, want in point["values"].items()}
        assert max(worst.values()) <= float(case["tolerance"]), (point["t"], max(worst, key=worst.get))


@pytest.mark.parametrize("name", CASES)
def test_instants_and_impulses_are_those_of_the_reference(name):
    case = CASES[name]
    _, _, incidents, names = motion(name)
    found = list(instants(incidents, names))
    if "impact_count" in case:
        # Two walls are struck at one instant once, and it counts twice.
        assert sum(each.kind == "impact" for each in incidents) == case["impact_count"]
    elif "accumulation" not in case:
        assert len(found) == len(case["events"])
    tolerance = float(case["event_tolerance"])
    for (t, kind, of, impulses), want in zip(found, case["events"], strict=False):
        assert kind == want["kind"]
        assert off(t, want["t"]) <= tolerance
        given = want.get("impulses", {}) | want.get("equality_impulses", {})
        assert of >= set(want.get("names", want.get("impulses", ())))
        for row_name in names:
            assert off(impulses[row_name], given.get(row_name, 0)) <= tolerance, (row_name, t)


def test_rebounds_of_the_reference_end_at_their_limit():
    case = CASES["zeno-floor"]
    _, _, incidents, _ = motion("zeno-floor")
    (end,) = [each for each in incidents if each.kind == "accumulation"]
    assert off(end.t, case["accumulation"]) <= float(case["event_tolerance"])
    assert [each.kind for each in incidents if each.t == end.t] == ["accumulation", "contact"]


# siconos-tutorials b6c9bfd, examples/mechanics: parameters from NAME.cpp, numbers from NAME.ref, which are held there
# to 1e-12 (1e-10 the oscillator). A ball is a point whose gap is its height.
BALL = """
lagcli: 1
parameters: {{g: {g}, e: {e}}}
particles:
  ball: {{mass: 1, position: [0, 0, {z}], velocity: [0, 0, {v}]}}
forces:
  weight: {{to: ball, force: [0, 0, -m*g]}}
inequality:
  floor: {{condition: ball.z >= 0, restitution: e}}
"""
TIGHT = {"rtol": 1e-11, "atol": 1e-13, "samples": 2}


def blows(text, duration, column, **settings):
    """Instant, velocity before, velocity after of each impact."""
    columns, _, incidents, _ = run(text, duration=duration, **{**TIGHT, **settings})
    at = columns.index(column) - 1
    hits = [each for each in incidents if each.kind == "impact"]
    return np.array([[each.t, each.before[at], each.after[at]] for each in hits])


# BouncingBallEventDriven/BouncingBallED: t, v-, v+ of the first four impacts and of the last two of 44.
SICONOS_BALL = [
    [0.4515236409857308, -4.429446918070019, 3.986502226263017],
    [1.264266194760045, -3.98650222626301, 3.587852003636709],
    [1.995734493156927, -3.587852003636701, 3.229066803273031],
    [2.654055961714119, -3.229066803273018, 2.906160122945717],
]


def test_bouncing_ball_of_siconos():
    found = blows(BALL.format(g=9.81, e=0.9, z=1, v=0), 2.7, "ball.vz")
    np.testing.assert_allclose(found, SICONOS_BALL, rtol=0, atol=1e-11)


def test_bouncing_ball_of_siconos_near_its_end():
    found = blows(BALL.format(g=9.81, e=0.9, z=1, v=0), 8.5, "ball.vz")
    want = [8.491374025642981, -4.772845842674625e-02, 4.295561258407163e-02]
    np.testing.assert_allclose(found[-1], want, rtol=0, atol=1e-9)


def test_ball_of_siconos_that_starts_with_an_impact():
    """BouncingBallEventDriven/BouncingBallED-initialImpact: the first four impacts, of which one is at the start."""
    found = blows(BALL.format(g=9.81, e=0.9, z=0, v=-1), 0.5, "ball.vz")
    want = [
        [0, -1, 0.9],
        [0.18348623853211, -0.9, 0.81],
        [0.3486238532110067, -0.81, 0.729],
        [0.4972477064220083, -0.729, 0.6561],
    ]
    np.testing.assert_allclose(found, want, rtol=0, atol=1e-11)


def test_ball_of_siconos_that_stays():
    """BouncingBallEventDriven/BouncingBallED-withRestingContact: impact at restitution 0, and its weight after it."""
    columns, table, incidents, _ = run(BALL.format(g=9.81, e=0, z=1, v=0), duration=8.5, **TIGHT)
    assert [each.kind for each in incidents] == ["impact", "contact"]
    assert incidents[0].t == pytest.approx(0.4515236409857311, abs=1e-12)
    assert incidents[0].impulses == pytest.approx([4.429446918070021], abs=1e-11)
    assert table[-1, columns.index("lambda.floor")] == pytest.approx(9.81, abs=1e-12)


# BouncingBallEventDriven/BouncingBallED-TwoContacts: a ball between floor and ceiling, e = 0.8, g = 10.
SICONOS_TWO_CONTACTS = [
    [0.0513167019494863, 9.486832980505138, -7.589466384404112],
    [0.2283187800528825, -9.359487165438074, 7.487589732350459],
    [0.4665486160195453, 5.10529137268383, -4.084233098147063],
    [0.7413599657472243, -6.832346595423852, 5.465877276339082],
    [1.83453542101504, -5.465877276339075, 4.37270182107126],
    [2.709075785229291, -4.372701821071252, 3.498161456857002],
    [3.40870807660069, -3.49816145685699, 2.798529165485591],
    [3.968413909697808, -2.79852916548558, 2.238823332388464],
]


TWO_CONTACTS = BALL.format(g=10, e=0.8, z=1, v=10) + "  ceiling: {condition: ball.z <= 1.5, restitution: e}\n"


def test_ball_of_siconos_between_two_contacts():
    found = blows(TWO_CONTACTS, 4.0, "ball.vz")
    np.testing.assert_allclose(found, SICONOS_TWO_CONTACTS, rtol=0, atol=1e-11)
    columns, table, _, _ = run(TWO_CONTACTS, duration=10, **TIGHT)
    assert table[-1, columns.index("lambda.floor")] == pytest.approx(10, abs=1e-9)


def test_rebounds_of_a_motion_that_dies_away_are_summed():
    """The series of 2 v/g (1 + e + e^2 + ...) after the last of these; Siconos goes along it and stops 4e-7 before."""
    _, _, incidents, _ = run(TWO_CONTACTS, duration=10, **TIGHT)
    (end,) = [each for each in incidents if each.kind == "accumulation"]
    assert end.t == pytest.approx(3.968413909697808 + 2 * 2.238823332388464 / 10 / (1 - 0.8), abs=1e-9)
    assert len(incidents) < 80


def test_the_end_of_rebounds_is_reported_with_the_state_of_its_instant():
    columns, _, incidents, _ = motion("zeno-floor")
    (end,) = [each for each in incidents if each.kind == "accumulation"]
    assert end.after[columns.index("a.x") - 1] == pytest.approx(0.4 * end.t, abs=1e-12)
    assert end.impulses == pytest.approx([0.0], abs=0.0)


COLUMN = """
lagcli: 1
parameters: {N: 10, R: 0.005, H: 0.05, g: 9.81, pi_there: 3.14159265, density: 7780}
coordinates:
  q[i]: {for: "i = 1..N", value: H + (2*i - 1)*R}
definitions:
  M: 4/3*pi_there*R**3*density
lagrangian: LAGRANGIAN
inequality:
  wall: {condition: "q[1] >= R", restitution: 1}
  c[i]: {for: "i = 2..N", condition: "q[i] - q[i-1] >= 2*R", restitution: 1}
"""


def test_column_of_beads_of_siconos():
    """ColumnOfBeads/BeadColumnED_NewtonLaw: ten touching beads fall on a wall, e = 1, and all fly up again."""
    terms = " + ".join(f"M*(rate(q[{i}])**2/2 - g*q[{i}])" for i in range(1, 11))
    text = COLUMN.replace("LAGRANGIAN", terms)
    columns, table, incidents, names = run(text, duration=0.493, **TIGHT)
    hits = list(instants(incidents, names, ("impact",)))
    assert [t for t, _, _, _ in hits] == pytest.approx([0.1009637554692305, 0.3028912664076932], abs=1e-11)
    speeds = [columns.index(f"rate(q[{i}])") for i in range(1, 11)]
    first = next(each for each in incidents if each.kind == "impact")
    assert first.before[np.array(speeds) - 1] == pytest.approx([-0.990454441153151] * 10, abs=1e-11)
    assert first.after[np.array(speeds) - 1] == pytest.approx([0.990454441153155] * 10, abs=1e-11)
    assert table[-1, speeds] == pytest.approx([-0.87451223538736] * 10, abs=1e-10)
    places = [columns.index(f"q[{i}]") for i in range(1, 11)]
    assert table[-1, places] == pytest.approx([0.016020812954015 + 0.01 * i for i in range(10)], abs=1e-11)


def test_oscillator_of_siconos_that_strikes_a_wall():
    """BouncingBallEventDriven/LinearOscillatorED: q = 1 at rest, k = 100, m = 1e-3, e = 0.9."""
    text = BALL.format(g=9.81, e=0.9, z=1, v=0).replace("mass: 1,", "mass: 1e-3,")
    text = text.replace("inequality:", "  spring: {potential: 50*ball.z**2}\ninequality:")
    found = blows(text, 0.005, "ball.vz")
    want = [[4.966983943888618e-03, -316.2587864392096, 284.6329077952886]]
    np.testing.assert_allclose(found, want, rtol=1e-9)
