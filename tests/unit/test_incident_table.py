"""The table of incidents: its columns, its formats, and what reads back."""

import csv
import json
import pickle
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest

import lagcli
from lagcli.output.files import formats
from lagcli.output.tables import incident_table, sinks
from lagcli.output.tables.incident_table import IncidentTable
from lagcli.output.tables.table_format import UnreadableTable
from tests.helpers import incidents

MODEL = lagcli.loads(incidents.BALL)
LAYOUT = incidents.layout(MODEL)
NAMES = (
    "t", "kind", "name", "impulse.floor", "impulse.wall", "a.x", "a.y", "a.z", "theta",
    "before.a.vx", "before.a.vy", "before.a.vz", "before.rate(theta)",
    "after.a.vx", "after.a.vy", "after.a.vz", "after.rate(theta)",
)  # fmt: skip
FOUND = [
    incidents.incident(MODEL, 1 / 3, "impact", "floor"),
    incidents.incident(MODEL, 1 / 3, "contact", "floor"),
    incidents.incident(MODEL, 0.5, "release", "floor", push=0.0),
    incidents.incident(MODEL, 0.7, "event", 'low, "very"', push=-0.0),
]
FORMATS = pytest.mark.parametrize("fmt", formats.TABLES)


def written(path: Path, block: int = 3) -> Path:
    with sinks.open_sink(path, LAYOUT.names, texts=("kind", "name"), provenance={"version": "1"}) as sink:
        for start in range(0, len(FOUND), block):
            part = FOUND[start : start + block]
            sink.write(LAYOUT.numbers(part), LAYOUT.words(part))
    return path


def test_columns_are_impulses_then_positions_then_velocities_twice() -> None:
    assert LAYOUT.names == NAMES
    row = dict(
        zip([n for n in NAMES if n not in ("kind", "name")], LAYOUT.numbers(FOUND[:1])[0], strict=True)
    )
    t = 1 / 3
    assert row["t"] == t
    assert (row["impulse.floor"], row["impulse.wall"]) == (2.0, 0.0)
    assert (row["a.z"], row["theta"]) == (100 * t + 2, 100 * t + 6)
    assert (row["before.a.vz"], row["after.a.vz"]) == (100 * t + 5, -(100 * t + 5))
    assert row["before.rate(theta)"] == row["after.rate(theta)"] == 100 * t + 7


@FORMATS
@pytest.mark.parametrize("block", [1, 3])
def test_a_table_of_every_format_reads_back_to_the_same_doubles(tmp_path: Path, fmt: str, block: int) -> None:
    found = incident_table.read(written(tmp_path / f"events.{fmt}", block))
    assert found.columns == NAMES
    assert found.kinds == ("impact", "contact", "release", "event")
    assert found.names == ("floor", "floor", "floor", 'low, "very"')
    assert found.numbers.tobytes() == LAYOUT.numbers(FOUND).tobytes()
    assert [path.name for path in tmp_path.iterdir()] == [f"events.{fmt}"]


@FORMATS
def test_a_run_without_incidents_has_a_table_without_rows(tmp_path: Path, fmt: str) -> None:
    path = tmp_path / f"events.{fmt}"
    with sinks.open_sink(path, LAYOUT.names, texts=("kind", "name")):
        pass
    found = incident_table.read(path)
    assert (found.columns, len(found)) == (NAMES, 0)


def test_other_programs_read_the_formats(tmp_path: Path) -> None:
    for ending, delimiter in (("csv", ","), ("tsv", "\t")):
        with written(tmp_path / f"events.{ending}").open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file, delimiter=delimiter))
        assert [row["name"] for row in rows] == [incident.name for incident in FOUND]
        assert [float(row["t"]) for row in rows] == [incident.t for incident in FOUND]
        assert rows[3]["impulse.floor"] == "0.0"
    content = json.loads(written(tmp_path / "events.json").read_text(encoding="utf-8"))
    assert content["provenance"] == {"version": "1"}
    assert content["rows"][3][:5] == [0.7, "event", 'low, "very"', 0.0, 0.0]
    with np.load(written(tmp_path / "events.npz"), allow_pickle=False) as archive:
        assert tuple(archive.files) == NAMES
        assert archive["kind"].dtype.kind == "U"
        assert list(archive["kind"]) == [incident.kind for incident in FOUND]
    content = pyarrow.parquet.read_table(written(tmp_path / "events.parquet"))
    assert {str(field.type) for field in content.schema} == {"double", "string"}
    assert content["name"].to_pylist()[3] == 'low, "very"'


def test_a_sink_takes_rows_with_their_texts_only(tmp_path: Path) -> None:
    with sinks.open_sink(tmp_path / "events.csv", LAYOUT.names, texts=("kind", "name")) as sink:
        for texts in ((), (["impact"],), (["impact"], [])):
            with pytest.raises(ValueError, match="texts that do not fit"):
                sink.write(LAYOUT.numbers(FOUND[:1]), texts)
        sink.discard()


def test_the_incidents_of_a_run_are_a_sequence_with_names() -> None:
    table = LAYOUT.table(FOUND)
    assert len(table) == 4
    first = table[0]
    assert (first.t, first.kind, first.name) == (1 / 3, "impact", "floor")
    assert first.impulses == {"floor": 2.0, "wall": 0.0}
    assert list(first.at) == ["a.x", "a.y", "a.z", "theta"]
    assert list(first.before) == list(first.after) == ["a.vx", "a.vy", "a.vz", "rate(theta)"]
    assert first.after["a.vz"] == -first.before["a.vz"]
    assert repr(first) == "<impact of floor at t = 0.333333333, impulses {floor: 2}>"
    assert table[-1].name == 'low, "very"'
    assert [row.kind for row in table] == ["impact", "contact", "release", "event"]
    assert [row.kind for row in table[1:3]] == ["contact", "release"]
    with pytest.raises(IndexError):
        table[4]


def test_they_are_a_mapping_of_columns_too() -> None:
    table = LAYOUT.table(FOUND)
    assert tuple(dict(table)) == table.keys() == NAMES
    np.testing.assert_array_equal(table["t"], table.t)
    assert list(table["kind"]) == ["impact", "contact", "release", "event"]
    assert table["after.a.vz"][0] == table[0].after["a.vz"]
    assert "impulse.floor" in table
    assert "impulse.roof" not in table
    with pytest.raises(KeyError, match=r"after\.a\.vz`"):
        table["after.a.vzz"]


def test_they_are_chosen_by_kind_and_name() -> None:
    table = LAYOUT.table(FOUND)
    assert [row.t for row in table.of("impact")] == [1 / 3]
    assert [row.kind for row in table.of(name="floor")] == ["impact", "contact", "release"]
    assert not table.of("release", "wall")


def test_the_repr_is_short_and_a_copy_is_the_same() -> None:
    table = LAYOUT.table(FOUND)
    assert repr(table) == "<IncidentTable: 1 impact, 1 contact, 1 release, 1 event; t = 0.333333333 to 0.7>"
    assert repr(table[:0]) == "<IncidentTable: no incidents>"
    again = pickle.loads(pickle.dumps(table))
    assert (again.columns, again.kinds, again.names) == (table.columns, table.kinds, table.names)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("t,kind\n0,impact\n", "has no column `name`"),
        ("t,kind,name\n0,bang,floor\n", "row 1 is of the kind 'bang'"),
        ("t,kind,name\n1,impact,a\n0.5,impact,a\n", "the time in row 2 is before that of the row above"),
        ("t,kind,name\nnan,impact,a\n", "the time in row 1"),
        (f"t,kind,name\n0,impact,{'a' * 1001}\n", "which is no word"),
        ("t,kind,name\n0,impact\n", "row 1 has 2 entries"),
    ],
)
def test_a_file_that_is_no_table_of_events_is_refused(tmp_path: Path, text: str, reason: str) -> None:
    path = tmp_path / "events.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(UnreadableTable, match=reason):
        incident_table.read(path)


def test_columns_of_text_of_another_type_are_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "events.npz", t=[0.0], kind=[1.0], name=["a"])
    with pytest.raises(UnreadableTable, match="`kind` is no column of text"):
        incident_table.read(tmp_path / "events.npz")
    (tmp_path / "events.json").write_text('{"columns": ["t", "kind", "name"], "rows": [[0, 1, "a"]]}')
    with pytest.raises(UnreadableTable, match="row 1: 'kind' holds '1', which is no word"):
        incident_table.read(tmp_path / "events.json")
    columns = {"t": [0.0], "kind": [1.0], "name": ["a"]}
    pyarrow.parquet.write_table(pyarrow.table(columns), tmp_path / "events.parquet")
    with pytest.raises(UnreadableTable, match="`kind` holds numbers and no text"):
        incident_table.read(tmp_path / "events.parquet")


def test_columns_of_another_program_are_kept() -> None:
    table = IncidentTable(("t", "kind", "name", "note"), ["impact"], ["floor"], np.array([[1.0, 7.0]]))
    assert table["note"][0] == 7.0
    assert table[0].at == {"note": 7.0}


HOSTILE = """lagcli: 1
particles:
  before: {mass: 1, position: [0, 0, 1]}
  impulse: {mass: 1, position: [0, 1, 3]}
forces: {weight: {to: all, force: "[0, 0, -m*10]"}}
inequality: {NAME: {condition: before.z >= 0, restitution: 0.5}}
"""


def test_particles_may_have_the_names_of_columns() -> None:
    run = lagcli.simulate(lagcli.loads(HOSTILE.replace("NAME", "floor")), duration=0.5, samples=3)
    row = run.events[0]
    assert list(row.impulses) == ["floor"]
    assert list(row.at) == [f"{name}.{axis}" for name in ("before", "impulse") for axis in "xyz"]
    assert row.before["before.vz"] < 0 < row.after["before.vz"]
    with pytest.raises(lagcli.ModelError, match="particle `impulse`"):
        lagcli.loads(HOSTILE.replace("NAME", "x"))
