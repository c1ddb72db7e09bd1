"""Tables from anywhere: what is read, and what is refused with a reason before it costs memory or time."""

import io
import json
import struct
import zipfile
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import lagcli
from lagcli.output.tables import csv_format, json_format, sinks, table_format
from tests.helpers.in_process import run

Floats = npt.NDArray[np.float64]
MODEL = """\
lagcli: 1
particles: {a: {mass: 1, position: [0, 0, 1], velocity: [1, 0, 0]}}
"""
COLUMNS = ("t", "a.x", "a.y", "a.z", "a.vx", "a.vy", "a.vz", "R.a.x", "R.a.y", "R.a.z", "energy")


@pytest.fixture(scope="module")
def rows() -> Floats:
    run = lagcli.simulate(lagcli.loads(MODEL), duration=1, samples=41)
    return np.column_stack([run.rows[:, run.columns.index(name)] for name in COLUMNS])


def text_of(rows: Floats, end: str = "\n") -> str:
    lines = [",".join(COLUMNS), *(",".join(map(repr, row)) for row in rows.tolist())]
    return end.join(lines) + end


def audited(folder: Path, name: str, data: bytes | None = None) -> tuple[int, str, str]:
    """The exit code and what is said of a table that stands in `folder`."""
    model = folder / "model.yaml"
    model.write_text(MODEL, encoding="utf-8")
    if data is not None:
        (folder / name).write_bytes(data)
    out, err, code = run("audit", model, "--run", folder / name)
    return code, out, err


def arrays(path: Path, columns: dict[str, object], method: int = zipfile.ZIP_STORED) -> None:
    """An archive of arrays, or of bytes as they are."""
    with zipfile.ZipFile(path, "w", method) as archive:
        for name, column in columns.items():
            if isinstance(column, bytes):
                archive.writestr(f"{name}.npy", column)
                continue
            data = io.BytesIO()
            np.lib.format.write_array(data, np.asarray(column), allow_pickle=True)
            archive.writestr(f"{name}.npy", data.getvalue())


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("mark", ["", "\ufeff"])
@pytest.mark.parametrize("after", ["", "\n", "\r\n\r\n"])
def test_marks_line_ends_and_blank_last_lines_are_read(
    tmp_path: Path, rows: Floats, mark: str, end: str, after: str
) -> None:
    path = tmp_path / "run.csv"
    path.write_bytes((mark + text_of(rows, end) + after).encode())
    columns, back = table_format.read(path)
    assert columns == COLUMNS
    np.testing.assert_array_equal(back, rows)


def test_quotes_and_a_missing_last_line_end_are_read(tmp_path: Path, rows: Floats) -> None:
    text = "\n".join(
        ",".join(f'"{cell}"' for cell in line.split(",")) for line in text_of(rows).split("\n") if line
    )
    code, out, _ = audited(tmp_path, "run.csv", text.encode())
    assert (code, out.splitlines()[-1]) == (0, "All checks passed.")


@pytest.mark.parametrize("kind", ["<f4", ">f8", "<f8", "|i1", "<u4"])
@pytest.mark.parametrize("method", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])
def test_arrays_of_plain_numbers_are_read(tmp_path: Path, kind: str, method: int) -> None:
    values = np.arange(5).astype(kind)
    arrays(tmp_path / "run.npz", {"t": values, "note": np.array("by hand"), "grid": np.zeros((2, 2))}, method)
    table = table_format.opened(tmp_path / "run.npz")
    assert table.columns == ("t", "note", "grid")
    np.testing.assert_array_equal(table.take(["t"])[:, 0], np.arange(5.0))


def test_columns_that_are_not_asked_for_may_hold_anything(tmp_path: Path, rows: Floats) -> None:
    columns = {name: pa.array(rows[:, k]) for k, name in enumerate(COLUMNS)}
    dates = pa.array(range(len(rows)), pa.timestamp("s"))
    pq.write_table(pa.table({**columns, "date": dates, "note": ["x"] * len(rows)}), tmp_path / "run.parquet")
    code, out, err = audited(tmp_path, "run.parquet")
    assert (code, err) == (0, "")
    assert "Columns that no check looks at: date, note." in out
    assert table_format.opened(tmp_path / "run.parquet").columns == (*COLUMNS, "date", "note")


# Damaged tables: exit 2, a line that says why, and nothing of Python or of a library but its reason.


def refused(folder: Path, name: str, data: bytes | None = None) -> str:
    code, out, err = audited(folder, name, data)
    assert (code, out) == (2, ""), (code, err)
    assert err.startswith("lagcli: --run")
    assert err.count("\n") == 1
    assert "None" not in err
    return err


GOOD = "t,a.x\n0,1\n"
TEXTS = {
    "empty": ("", "lacks"),
    "header alone": (",".join(COLUMNS), "no rows"),
    "another separator": ("t;a.x\n0;1\n", "not separated by commas"),
    "tabs": ("t\ta.x\n0\t1\n", "not separated by commas"),
    "long name": ("x" * 200_000 + "\n1\n", "field limit"),
    "long field": (",".join(COLUMNS) + "\n" + "1" * 200_000 + "\n", "field limit"),
    "open quote": (",".join(COLUMNS) + '\n"0,0\n1\n', "unexpected end"),
    "quote in a number": (",".join(COLUMNS) + "\n" + ",".join(['1"2'] * 11) + "\n", "is no number"),
    "zero bytes": (",".join(COLUMNS) + "\n" + ",".join(["1\0"] * 11) + "\n", "is no number"),
    "underscores": (",".join(COLUMNS) + "\n" + ",".join(["1_0"] * 11) + "\n", "is no number"),
    "other digits": (",".join(COLUMNS) + "\n" + ",".join(["١"] * 11) + "\n", "is no number"),
    "short row": (",".join(COLUMNS) + "\n" + ",".join(["1"] * 7) + "\n", "row 1 has 7 entries for 11"),
    "blank row": (",".join(COLUMNS) + "\n\n" + ",".join(["1"] * 11) + "\n", "row 1 has 0 entries"),
    "equal names": ("t,t\n0,1\n", "two columns of one name"),
    "a row without end": (",".join(COLUMNS) + "\n" + "1," * (csv_format.MOST_LINE // 2 + 1), "a row has"),
    "a row of many lines": ('"\n",' * (csv_format.MOST_LINE // 4 + 1), "a row has"),
}  # fmt: skip


@pytest.mark.parametrize("name", TEXTS)
def test_damaged_csv(tmp_path: Path, name: str) -> None:
    text, reason = TEXTS[name]
    assert reason in refused(tmp_path, "run.csv", text.encode())


@pytest.mark.parametrize("encoding", ["utf-16", "latin-1"])
def test_csv_that_is_not_utf8(tmp_path: Path, rows: Floats, encoding: str) -> None:
    assert "utf-8" in refused(tmp_path, "run.csv", ("é," + text_of(rows)).encode(encoding))


def of_rows(*rows: object) -> str:
    return json.dumps({"columns": COLUMNS, "rows": rows})


JSONS = {
    "empty": ("", "empty document"),
    "deep lists": ("[" * 100_000, "depth limit"),
    "deep objects": ('{"columns":' * 50_000, "depth limit"),
    "no object": ("[1, 2]", "no object"),
    "no lists": ('{"columns": "t", "rows": []}', "no object"),
    "names that are lists": ('{"columns": [["t"]], "rows": []}', "no text"),
    "no rows": (of_rows(), "no rows"),
    "rows that are numbers": (of_rows(1, 2), "no list"),
    "short row": (of_rows([1]), "1 entries for 11"),
    "texts": (of_rows(["0"] * 11), "no number"),
    "truth values": (of_rows([True] * 11), "no number"),
    "lists in a row": (of_rows([[1]] * 11), "no number"),
    "huge integer": (of_rows([0] * 11).replace("0", "1" + "0" * 400), "infinity"),
    "not a number": (of_rows([0] * 11).replace("0", "NaN"), "unexpected character"),
    "torn": (of_rows([0] * 11)[:-20], "end of data"),
    "half a letter": ('{"columns": ["\\ud800"], "rows": []}', "surrogate"),
}


@pytest.mark.parametrize("name", JSONS)
def test_damaged_json(tmp_path: Path, name: str) -> None:
    text, reason = JSONS[name]
    assert reason in refused(tmp_path, "run.json", text.encode())


def header(shape: str, kind: str = "'<f8'", version: int = 1) -> bytes:
    text = f"{{'descr': {kind}, 'fortran_order': False, 'shape': {shape}, }}\n".encode()
    size = struct.pack("<H" if version == 1 else "<I", len(text))
    return b"\x93NUMPY" + bytes([version, 0]) + size + text + b"\0" * 328


ODD_ARRAYS = {
    "complex": np.zeros(41, complex),
    "dates": np.arange(41).astype("M8[s]"),
    "durations": np.arange(41).astype("m8[s]"),
    "texts": np.array(["1"] * 41),
    "objects": np.array([None] * 41, dtype=object),
    "structures": np.zeros(41, dtype=[("a", "f8")]),
    "truth values": np.zeros(41, dtype=bool),
    "long doubles": np.zeros(41, dtype=np.longdouble),
    "a table": np.zeros((41, 1)),
    "another length": np.zeros(20),
    "one number": np.array(1.0),
    "a claim of 1e12 numbers": header("(1000000000000,)"),
    "a claim of 1e30 numbers": header(f"({10**30},)"),
    "a negative length": header("(-1,)"),
    "a type that is none": header("(41,)", "'<f1'"),
    "an expression": header("(41,)", "__import__('os').getcwd()"),
    "no header": b"\x93NUM",
    "a long header": header("(41,)" + " " * 10_000, version=2),
    "brackets": header("(" * 3000, version=2),
}


@pytest.mark.parametrize("name", ODD_ARRAYS)
def test_arrays_that_are_no_columns(tmp_path: Path, rows: Floats, name: str) -> None:
    if name == "long doubles" and np.dtype(np.longdouble).itemsize == 8:
        pytest.skip("long doubles are doubles here")
    columns: dict[str, object] = {column: rows[:, k] for k, column in enumerate(COLUMNS)}
    arrays(tmp_path / "run.npz", {**columns, "t": ODD_ARRAYS[name]})
    assert "run.npz is no table" in refused(tmp_path, "run.npz")


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_other_methods_of_compression_are_named(tmp_path: Path, rows: Floats, method: int) -> None:
    arrays(tmp_path / "run.npz", {column: rows[:, k] for k, column in enumerate(COLUMNS)}, method)
    assert "compressed by a method that NumPy does not write" in refused(tmp_path, "run.npz")


def test_damaged_archives(tmp_path: Path, rows: Floats) -> None:
    """Every byte that a torn copy or a bad disk may change: the table is read or refused, and nothing else happens."""
    arrays(
        tmp_path / "good.npz", {column: rows[:, k] for k, column in enumerate(COLUMNS)}, zipfile.ZIP_DEFLATED
    )
    good = (tmp_path / "good.npz").read_bytes()
    random = np.random.default_rng(1)
    damaged = [good[:length] for length in (0, 10, len(good) // 2, len(good) - 5)]
    for number in range(150):
        data = bytearray(good)
        # The list of members stands at the end.
        first = 0 if number % 2 else len(good) - 900
        data[int(random.integers(first, len(good)))] ^= int(random.integers(1, 256))
        damaged.append(bytes(data))
    reasons = []
    for data in damaged:
        (tmp_path / "run.npz").write_bytes(data)
        try:
            table = table_format.opened(tmp_path / "run.npz")
            if set(COLUMNS) <= set(table.columns):
                table.take(COLUMNS)
        except table_format.UnreadableTable as error:
            reasons.append(str(error))
    assert len(reasons) > 60
    assert not any("None" in reason for reason in reasons)


def test_encrypted_archives_are_named(tmp_path: Path, rows: Floats) -> None:
    arrays(tmp_path / "run.npz", {column: rows[:, k] for k, column in enumerate(COLUMNS)})
    data = bytearray((tmp_path / "run.npz").read_bytes())
    for mark, place in ((b"PK\x01\x02", 8), (b"PK\x03\x04", 6)):
        data[data.index(mark) + place] |= 1
    assert "encrypted" in refused(tmp_path, "run.npz", bytes(data))


PARQUETS = {
    "timestamps": pa.array(range(41), pa.timestamp("s")),
    "dates": pa.array(range(41), pa.date32()),
    "times": pa.array(range(41), pa.time32("s")),
    "durations": pa.array(range(41), pa.duration("s")),
    "texts": pa.array(["1"] * 41),
    "truth values": pa.array([True] * 41),
    "lists": pa.array([[1.0]] * 41),
    "structures": pa.array([{"a": 1.0}] * 41),
    "decimals": pa.array([1] * 41).cast(pa.decimal128(20)),
    "nothing": pa.nulls(41),
    "words in a dictionary": pa.array(["1"] * 41).dictionary_encode(),
}


@pytest.mark.parametrize("name", PARQUETS)
def test_parquet_columns_that_are_no_numbers(tmp_path: Path, rows: Floats, name: str) -> None:
    columns = {column: pa.array(rows[:, k]) for k, column in enumerate(COLUMNS)}
    pq.write_table(pa.table({**columns, "t": PARQUETS[name]}), tmp_path / "run.parquet")
    assert "`t` holds" in refused(tmp_path, "run.parquet")


def test_damaged_parquet(tmp_path: Path, rows: Floats) -> None:
    with sinks.open_sink(tmp_path / "good.parquet", COLUMNS) as sink:
        sink.write(rows)
    good = (tmp_path / "good.parquet").read_bytes()
    for data in (b"", b"PAR1" + b"\0" * 8 + b"PAR1", good[:-4] + b"PARE", good[: len(good) // 2], b"PAR1"):
        assert "run.parquet is no table" in refused(tmp_path, "run.parquet", data)
    random, reasons = np.random.default_rng(2), []
    for _ in range(60):
        data = bytearray(good)
        data[-int(random.integers(1, 2500))] ^= int(random.integers(1, 256))
        (tmp_path / "run.parquet").write_bytes(data)
        try:
            table_format.read(tmp_path / "run.parquet")
        except table_format.UnreadableTable as error:
            reasons.append(str(error))
    assert reasons
    assert not any("None" in reason for reason in reasons)


def test_values_that_are_missing_are_no_numbers(tmp_path: Path) -> None:
    pq.write_table(pa.table({"t": pa.array([None, 1.5]), "n": pa.array([3, None])}), tmp_path / "run.parquet")
    np.testing.assert_array_equal(
        table_format.read(tmp_path / "run.parquet")[1], [[np.nan, 3], [1.5, np.nan]]
    )


# Sizes are looked at first.


def bomb(path: Path, names: tuple[str, ...], numbers: int) -> None:
    """Deflated zeros."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in names:
            with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
                np.lib.format.write_array_header_1_0(
                    file, {"descr": "<f8", "fortran_order": False, "shape": (numbers,)}
                )
                for _ in range(0, numbers, 1 << 20):
                    file.write(bytes(8 << 20))


def test_sizes_are_looked_at_before_anything_is_loaded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bomb(tmp_path / "two.npz", ("t", "a.x"), 1 << 21)
    bomb(tmp_path / "all.npz", COLUMNS, 1 << 20)
    zeros = pa.array(np.zeros(1 << 20))
    pq.write_table(pa.table({"t": zeros, "a.x": zeros}), tmp_path / "two.parquet")
    pq.write_table(pa.table(dict.fromkeys(COLUMNS, zeros)), tmp_path / "all.parquet")

    def nothing(*_: object, **__: object) -> None:
        raise AssertionError("numbers were read")

    monkeypatch.setattr(np, "frombuffer", nothing)
    monkeypatch.setattr(pq.ParquetFile, "iter_batches", nothing)
    for ending in ("npz", "parquet"):
        assert "lacks 8 of the 10 columns" in refused(tmp_path, f"two.{ending}")
        assert "is too large: 1048576 rows" in refused(tmp_path, f"all.{ending}")


def test_rows_of_text_are_counted_while_they_are_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(table_format, "MOST_NUMBERS", 110)
    text = ",".join(COLUMNS) + "\n" + ("0," * 10 + "0\n") * 11
    assert "too large: 11 rows or more of 11 columns" in refused(tmp_path, "run.csv", text.encode())
    assert "too large" in refused(tmp_path, "run.json", of_rows(*[[0] * 11] * 11).encode())
    monkeypatch.setattr(json_format, "MOST_JSON", 300)
    assert "is too large: a table in JSON" in refused(
        tmp_path, "run.json", of_rows(*[[0] * 11] * 11).encode()
    )


def test_limits() -> None:
    """What an audit of the largest table holds, and what a line and a JSON file may cost: see their comments."""
    assert table_format.MOST_NUMBERS * 400 == 2e9
    assert csv_format.MOST_LINE == 4 << 20
    assert json_format.MOST_JSON == 64 << 20


def test_a_folder_and_a_missing_file_are_named(tmp_path: Path) -> None:
    (tmp_path / "run.csv").mkdir()
    assert "cannot read" in refused(tmp_path, "run.csv")
    assert "there is no file" in refused(tmp_path, "other.csv")
