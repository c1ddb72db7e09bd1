"""Tables: what is written reads back to the same doubles; a target is the old file or the whole new one."""

import csv
import io
import json
import os
import subprocess
import sys
import tracemalloc
import zipfile
from pathlib import Path

import hypothesis
import numpy as np
import pyarrow.parquet
import pytest
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
from numpy.typing import NDArray

from lagcli.output.figures import chart
from lagcli.output.files import formats
from lagcli.output.tables import cell_text, sinks, table_format

NAMES = ("t", "p[1][2].x", "rate(theta)", "lambda.größe", "file")
HARD = [5e-324, 1e308, -0.0, 0.1, 1 / 3, -2.2250738585072014e-308, 1.7976931348623157e308, 123456789.0]
FORMATS = pytest.mark.parametrize("fmt", formats.TABLES)


def table(count: int = 40) -> NDArray[np.float64]:
    rng = np.random.default_rng(7)
    values = rng.standard_normal((count, len(NAMES))) * 10.0 ** rng.integers(-300, 300, (count, len(NAMES)))
    values.flat[: len(HARD)] = HARD
    return values


def read(path: Path, fmt: str) -> tuple[list[str], NDArray[np.float64]]:
    match fmt:
        case "csv" | "tsv":
            with open(path, encoding="utf-8", newline="") as file:
                header, *lines = csv.reader(file, delimiter="," if fmt == "csv" else "\t")
            return header, np.array([[float(word) for word in line] for line in lines]).reshape(
                -1, len(header)
            )
        case "json":
            content = json.loads(path.read_text(encoding="utf-8"))
            assert list(content) == ["columns", "rows"]
            names = content["columns"]
            return names, np.array(content["rows"], dtype=float).reshape(-1, len(names))
        case "npz":
            with np.load(path, allow_pickle=False) as archive:
                return list(archive.files), np.stack([archive[name] for name in archive.files], axis=1)
        case _:
            content = pyarrow.parquet.read_table(path)
            assert {str(field.type) for field in content.schema} == {"double"}
            return content.column_names, np.stack([column.to_numpy() for column in content.columns], axis=1)


def leftovers(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@FORMATS
@pytest.mark.parametrize("block", [1, 7, 1000])
def test_every_double_reads_back_with_all_its_bits(tmp_path: Path, fmt: str, block: int) -> None:
    path = tmp_path / f"run.{fmt}"
    rows = table()
    with sinks.open_sink(path, NAMES) as sink:
        buffer = np.empty((block, len(NAMES)))
        for start in range(0, len(rows), block):
            part = rows[start : start + block]
            buffer[: len(part)] = part
            sink.write(buffer[: len(part)])
            buffer[:] = -1.0  # a caller may use its array again
        sink.commit()
    names, values = read(path, fmt)
    assert tuple(names) == NAMES
    assert values.tobytes() == rows.tobytes()
    assert leftovers(tmp_path) == [f"run.{fmt}"]


@FORMATS
def test_a_table_without_rows_is_a_table(tmp_path: Path, fmt: str) -> None:
    path = tmp_path / f"run.{fmt}"
    sinks.open_sink(path, NAMES).commit()
    names, values = read(path, fmt)
    assert tuple(names) == NAMES
    assert values.shape == (0, len(NAMES))


@FORMATS
def test_equal_tables_give_equal_files(tmp_path: Path, fmt: str) -> None:
    for name in ("a", "b"):
        with sinks.open_sink(tmp_path / f"{name}.{fmt}", NAMES) as sink:
            sink.write(table())
    assert (tmp_path / f"a.{fmt}").read_bytes() == (tmp_path / f"b.{fmt}").read_bytes()


@FORMATS
def test_a_large_table_in_small_and_large_blocks_keeps_its_rows(tmp_path: Path, fmt: str) -> None:
    path = tmp_path / f"run.{fmt}"
    width, count = 400, 13_000  # beyond the memory that the column formats gather in
    if fmt in ("csv", "json"):
        count = 500
    names = tuple(f"c{index}" for index in range(width))
    rows = np.arange(width * count, dtype=float).reshape(count, width)
    with sinks.open_sink(path, names) as sink:
        sink.write(rows[:11])
        sink.write(rows[11:-1])
        sink.write(rows[-1:])
    back, values = read(path, fmt)
    assert tuple(back) == names
    assert np.array_equal(values, rows)


@FORMATS
def test_a_failed_run_leaves_the_old_file_and_nothing_else(tmp_path: Path, fmt: str) -> None:
    path = tmp_path / f"run.{fmt}"
    path.write_text("old")
    sink = sinks.open_sink(path, NAMES)

    def run() -> None:
        with sink:
            sink.write(table())
            assert path.read_text() == "old"
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run()
    assert path.read_text() == "old"
    assert leftovers(tmp_path) == [f"run.{fmt}"]


@FORMATS
def test_an_interrupted_run_keeps_its_rows_in_a_partial_file(tmp_path: Path, fmt: str) -> None:
    path = tmp_path / f"run.{fmt}"
    path.write_text("old")
    rows = table()
    with sinks.open_sink(path, NAMES) as sink:
        sink.write(rows)
        partial = sink.keep_partial()
    assert partial == tmp_path / f"run.{fmt}.partial"
    assert path.read_text() == "old"
    assert read(partial, fmt)[1].tobytes() == rows.tobytes()
    assert leftovers(tmp_path) == [f"run.{fmt}", f"run.{fmt}.partial"]


@FORMATS
def test_a_move_that_fails_leaves_nothing_behind(
    tmp_path: Path, fmt: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / f"run.{fmt}"
    path.write_text("old")

    def refuse(*_: object) -> None:
        raise PermissionError(13, "refused")

    sink = sinks.open_sink(path, NAMES)
    sink.write(table())
    monkeypatch.setattr(os, "replace", refuse)
    with pytest.raises(PermissionError):
        sink.commit()
    assert path.read_text() == "old"
    assert leftovers(tmp_path) == [f"run.{fmt}"]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs the device that is always full")
@FORMATS
def test_a_full_disk_is_an_oserror_and_a_device_is_not_replaced(tmp_path: Path, fmt: str) -> None:
    path = tmp_path / f"run.{fmt}"
    path.symlink_to("/dev/full")
    with pytest.raises(OSError, match="No space left"), sinks.open_sink(path, NAMES) as sink:
        sink.write(table(5000))
    assert path.is_symlink()
    assert Path("/dev/full").is_char_device()


def test_a_block_whose_writing_is_interrupted_leaves_no_torn_line(tmp_path: Path) -> None:
    file = cell_text.BlockFile(tmp_path / "blocks", b"one\n")
    inner = file._file

    class Interrupted:
        def __getattr__(self, name: str) -> object:
            return getattr(inner, name)

        def write(self, block: bytes) -> None:
            inner.write(block[:2])
            raise KeyboardInterrupt

    file._file = Interrupted()  # type: ignore[assignment]
    with pytest.raises(KeyboardInterrupt):
        file.append(b"torn\n")
    file._file = inner
    file.append(b"two\n")
    file.close()
    assert (tmp_path / "blocks").read_bytes() == b"one\ntwo\n"


def test_a_link_stays_a_link_and_access_rights_stay(tmp_path: Path) -> None:
    real = tmp_path / "elsewhere.csv"
    real.write_text("old")
    real.chmod(0o640)
    link = tmp_path / "run.csv"
    link.symlink_to(real)
    with sinks.open_sink(link, ("t",)) as sink:
        sink.write(np.zeros((1, 1)))
    assert link.is_symlink()
    assert real.read_bytes() == b"t\n0.0\n"
    if os.name == "posix":
        assert real.stat().st_mode & 0o777 == 0o640


def test_a_folder_that_is_missing_and_a_target_that_is_a_folder_are_named(tmp_path: Path) -> None:
    missing = tmp_path / "no" / "run.csv"
    with pytest.raises(FileNotFoundError) as caught:
        sinks.open_sink(missing, ("t",))
    assert caught.value.filename == str(missing)
    folder = tmp_path / "run.csv"
    folder.mkdir()
    with pytest.raises(IsADirectoryError):
        sinks.open_sink(folder, ("t",))
    assert leftovers(tmp_path) == ["run.csv"]


def test_an_unknown_ending_names_the_known_ones_and_writes_nothing(tmp_path: Path) -> None:
    with pytest.raises(formats.UnknownFormat, match=r"run\.xlsx.*\.csv, \.json, \.npz, \.parquet"):
        sinks.open_sink(tmp_path / "run.xlsx", NAMES)
    with pytest.raises(formats.UnknownFormat):
        sinks.open_sink(tmp_path / "run", NAMES)
    assert leftovers(tmp_path) == []
    sinks.open_sink(tmp_path / "RUN.CSV", NAMES).commit()
    assert leftovers(tmp_path) == ["RUN.CSV"]


def test_parquet_without_pyarrow_says_how_to_install_it(tmp_path: Path) -> None:
    script = (
        "import sys; sys.modules['pyarrow'] = None\n"
        "from lagcli.output.tables import sinks, table_format\n"
        "try:\n    sinks.open_sink(sys.argv[1], ('t',))\n"
        "except table_format.MissingExtra as error:\n    print(error)\n"
    )
    run = subprocess.run(
        [sys.executable, "-c", script, str(tmp_path / "run.parquet")],
        capture_output=True,
        text=True,
        check=True,
        cwd=Path(__file__).parents[2],
    )
    assert 'pip install "lagcli[parquet]"' in run.stdout
    assert leftovers(tmp_path) == []


def test_a_sink_refuses_rows_of_another_width_and_rows_after_its_end(tmp_path: Path) -> None:
    sink = sinks.open_sink(tmp_path / "run.csv", ("t", "x"))
    with pytest.raises(ValueError, match="2 columns"):
        sink.write(np.zeros((3, 3)))
    sink.commit()
    with pytest.raises(ValueError, match="ended"):
        sink.write(np.zeros((1, 2)))
    with pytest.raises(ValueError, match="one name"):
        sinks.open_sink(tmp_path / "two.csv", ("x", "x"))


def test_csv_has_unix_line_ends_and_quotes_names_that_need_it(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    with sinks.open_sink(path, ("t", 'a,"b"')) as sink:
        sink.write(np.array([[0.1, -0.0]]))
    assert path.read_bytes() == b't,"a,""b"""\n0.1,-0.0\n'
    assert read(path, "csv")[0] == ["t", 'a,"b"']


@pytest.mark.parametrize("fmt", ["csv", "json"])
@pytest.mark.parametrize("value", [np.inf, -np.inf])
def test_text_holds_no_infinite_value_and_the_column_is_named(tmp_path: Path, fmt: str, value: float) -> None:
    sink = sinks.open_sink(tmp_path / f"run.{fmt}", ("t", "x"))
    with pytest.raises(ValueError, match='"x"'), sink:
        sink.write(np.array([[0.0, value]]))
    assert leftovers(tmp_path) == []


@pytest.mark.parametrize("fmt", ["csv", "json", "npz", "parquet"])
def test_what_has_no_value_reads_back_as_nan(tmp_path: Path, fmt: str) -> None:
    path = tmp_path / f"run.{fmt}"
    rows = np.array([[0.0, 1.5], [np.nan, np.nan], [2.0, np.nan]])
    with sinks.open_sink(path, ("t", "x")) as sink:
        sink.write(rows)
    if fmt == "csv":
        assert path.read_bytes() == b"t,x\n0.0,1.5\nnan,nan\n2.0,nan\n"
    if fmt == "json":  # JSON has no nan
        assert json.loads(path.read_bytes())["rows"] == [[0.0, 1.5], [None, None], [2.0, None]]
    else:
        assert np.array_equal(read(path, fmt)[1], rows, equal_nan=True)


@hypothesis.given(
    npst.arrays(
        np.float64,
        npst.array_shapes(min_dims=2, max_dims=2, max_side=6),
        elements=st.floats(allow_nan=False, allow_infinity=False),
    )
)
@hypothesis.example(np.array([[-0.0, 0.5, 1.0, 1e-7, 1e16, 1e22, 5e-324, 2.0**53, 123456789.0, 1e-5]]))
def test_a_text_is_the_shortest_that_reads_back_to_the_same_double(rows: NDArray[np.float64]) -> None:
    lines = bytes(cell_text.csv_lines(rows)).decode()
    assert lines.endswith("\n")
    words = [line.split(",") for line in lines.splitlines()]
    assert np.array([[float(word) for word in line] for line in words]).tobytes() == rows.tobytes()
    for word, value in zip((word for line in words for word in line), rows.ravel().tolist(), strict=True):
        assert digits(word) == digits(repr(value))
    assert f"[{cell_text.json_lines(rows).decode()}]" == "[" + lines_as_json(words) + "]"


def digits(word: str) -> str:
    """The digits that count, without sign, point and exponent."""
    return word.lstrip("-").split("e")[0].replace(".", "").strip("0")


def lines_as_json(words: list[list[str]]) -> str:
    return ",\n".join(f"[{','.join(line)}]" for line in words)


def test_numbers_are_written_as_one_would_write_them() -> None:
    rows = np.array([[0.5, 1.0, -0.0, 0.1, 1e-3, -273.15, 123456789.0]])
    assert bytes(cell_text.csv_lines(rows)) == b"0.5,1.0,-0.0,0.1,0.001,-273.15,123456789.0\n"


@pytest.mark.parametrize("order", ["C", "F"])
def test_the_order_of_the_array_in_memory_does_not_matter(tmp_path: Path, order: str) -> None:
    rows = np.array(table(), order=order)[::2, ::-1]
    for fmt in formats.TABLES:
        with sinks.open_sink(tmp_path / f"run.{fmt}", NAMES[: rows.shape[1]]) as sink:
            sink.write(rows)
        assert read(tmp_path / f"run.{fmt}", fmt)[1].tobytes() == rows.tobytes()


def test_npz_holds_float64_vectors_under_plain_names(tmp_path: Path) -> None:
    path = tmp_path / "run.npz"
    with sinks.open_sink(path, NAMES) as sink:
        sink.write(table())
    with zipfile.ZipFile(path) as archive:
        assert archive.testzip() is None
    with np.load(path, allow_pickle=False) as arrays:
        assert arrays["file"].dtype == np.float64
        assert arrays["rate(theta)"].shape == (40,)


@pytest.mark.parametrize("fmt", ["csv", "json"])
def test_text_formats_stream_in_bounded_memory(tmp_path: Path, fmt: str) -> None:
    path = tmp_path / f"run.{fmt}"
    rows = np.full((100, 50), 1 / 3)
    with sinks.open_sink(path, [f"c{index}" for index in range(50)]) as sink:
        sink.write(rows)
        tracemalloc.start()
        for _ in range(40):
            sink.write(rows)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert path.stat().st_size > 3_500_000
    assert peak < 1_500_000


def test_one_large_block_is_turned_into_text_in_parts(tmp_path: Path) -> None:
    rows = np.full((20_000, 20), 1 / 3)
    with sinks.open_sink(tmp_path / "run.csv", [f"c{index}" for index in range(20)]) as sink:
        tracemalloc.start()
        sink.write(rows)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert (tmp_path / "run.csv").stat().st_size > 7_000_000
    assert peak < 7_500_000


class CountingStream(io.BytesIO):
    flushes = 0

    def flush(self) -> None:
        self.flushes += 1


def test_a_stream_gets_csv_and_is_flushed_after_every_block() -> None:
    stream = CountingStream()
    sink = sinks.open_sink(stream, ("t", "x"))
    assert stream.getvalue() == b""
    sink.write(np.array([[0.0, 1.0]]))
    assert stream.getvalue() == b"t,x\n0.0,1.0\n"
    assert stream.flushes == 1
    sink.write(np.array([[0.5, 2.0]]))
    sink.commit()
    assert stream.getvalue() == b"t,x\n0.0,1.0\n0.5,2.0\n"
    assert not stream.closed


def test_a_stream_without_rows_has_a_header() -> None:
    plain = io.BytesIO()
    with sinks.open_sink(plain, ("t",)) as sink:
        assert sink.keep_partial() is None
    assert plain.getvalue() == b"t\n"


def test_a_stream_that_fails_before_its_first_row_stays_empty() -> None:
    stream = io.BytesIO()
    with pytest.raises(RuntimeError), sinks.open_sink(stream, ("t",)):
        raise RuntimeError
    assert stream.getvalue() == b""


def test_a_reader_that_went_away_is_a_broken_pipe() -> None:
    far, near = os.pipe()
    os.close(far)
    stream = os.fdopen(near, "wb", buffering=0)
    with stream, pytest.raises(BrokenPipeError), sinks.open_sink(stream, ("t",)) as sink:
        sink.write(np.zeros((1, 1)))


TABLE = (
    "t",
    "p[1][2].x",
    "p[1][2].y",
    "p[2][1].x",
    "lambda.rod",
    "lambda.link[3]",
    "R.a.x",
    "R.a.y",
    "energy",
)


def chosen(patterns: str) -> list[str]:
    return [TABLE[index] for index in table_format.select(TABLE, patterns)]


def test_columns_come_in_the_order_of_the_patterns_then_of_the_table() -> None:
    assert chosen("R.a.*, t") == ["R.a.x", "R.a.y", "t"]
    assert chosen("energy,*") == ["energy", *TABLE[:-1]]
    assert chosen("t,t,*.x,p*") == ["t", "p[1][2].x", "p[2][1].x", "R.a.x", "p[1][2].y"]


def test_square_brackets_in_a_pattern_stand_for_themselves() -> None:
    assert chosen("p[1][2].x") == ["p[1][2].x"]
    assert chosen("p[1]*") == ["p[1][2].x", "p[1][2].y"]
    assert chosen("p[?][?].x") == ["p[1][2].x", "p[2][1].x"]
    assert chosen("lambda.link[*]") == ["lambda.link[3]"]
    with pytest.raises(table_format.UnknownColumn):
        chosen("p[12][2].x")
    with pytest.raises(table_format.UnknownColumn):
        chosen("[a-z]")


def test_a_pattern_covers_the_whole_name_and_its_case() -> None:
    with pytest.raises(table_format.UnknownColumn):
        chosen("lambda")
    with pytest.raises(table_format.UnknownColumn):
        chosen("r.a.*")


@pytest.mark.parametrize(
    ("pattern", "nearest"),
    [("lamda.rod", "lambda.rod"), ("lambda.rot*", "lambda.rod"), ("r.A.x", "R.a.x"), ("enery", "energy")],
)
def test_an_unknown_column_names_the_pattern_and_the_nearest_name(pattern: str, nearest: str) -> None:
    with pytest.raises(table_format.UnknownColumn) as caught:
        chosen(f"t,{pattern}")
    assert caught.value.pattern == pattern
    assert caught.value.nearest[0] == nearest
    assert pattern in str(caught.value)
    assert nearest in str(caught.value)


@pytest.mark.parametrize("name", ["a.ax", "p[3].az"])
def test_a_column_of_accelerations_is_an_output(name: str) -> None:
    with pytest.raises(table_format.UnknownColumn) as caught:
        table_format.select(["t", "a.x", "p[3].x", "a.vx"], name)
    assert f"`outputs: {{acc: {name}}}`" in str(caught.value)


def test_an_empty_pattern_is_refused() -> None:
    for patterns in ("", "t,,energy", "t,"):
        with pytest.raises(table_format.UnknownColumn):
            chosen(patterns)


def test_a_pattern_of_many_stars_is_answered_at_once() -> None:
    with pytest.raises(table_format.UnknownColumn):
        table_format.select(["a" * 200], "*a" * 40 + "b")


# Rows for a figure


@pytest.mark.parametrize(
    ("count", "block"), [(1, 1), (4096, 4096), (4097, 100), (100_000, 777), (65_537, 65_537)]
)
def test_rows_for_a_figure_are_bounded_and_even(count, block, monkeypatch):
    monkeypatch.setattr(chart, "NUMBERS", 1)
    table = np.column_stack([np.arange(count, dtype=float), np.arange(count) % 7.0])
    kept = chart.DecimatedRows()
    for start in range(0, count, block):
        kept.add(table[start : start + block])
    rows = kept.rows()
    assert len(rows) <= chart.FEWEST_ROWS + 1
    assert len(rows) >= min(count, chart.FEWEST_ROWS // 2)
    assert np.array_equal(rows, table[rows[:, 0].astype(int)])
    steps = np.diff(rows[:, 0])
    assert rows[0, 0] == 0
    assert rows[-1, 0] == count - 1
    assert len(set(steps[:-1])) <= 1


def test_no_rows_make_no_figure():
    assert len(chart.DecimatedRows().rows()) == 0
