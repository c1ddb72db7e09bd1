"""`lagcli plot`: any columns of any tables, in files and in the terminal."""

from __future__ import annotations

import dataclasses
import functools
import io
import re
import shlex
import shutil
import sys
import xml.etree.ElementTree
from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.api import plot
from lagcli.cli.commands import options
from lagcli.cli.terminal import exits
from lagcli.errors import diagnostics
from lagcli.output.figures import chart_figure, chart_table, chart_terminal, compose, figure_page, labels
from lagcli.output.figures.chart import ChartData
from lagcli.output.figures.chart import path as path_drawn
from lagcli.output.figures.chart_table import ChartTable
from lagcli.output.figures.compose import UndrawableColumns
from lagcli.output.tables import provenance
from tests.cli.test_figure import AWKWARD, texts
from tests.helpers import in_process

command = in_process.command

MODEL = """\
lagcli: 1
title: A ball and a pendulum
parameters: {L: 1, om: 2, g: 9.81}
coordinates: {th: {value: 0, rate: om}}
particles:
  a: {mass: 1, position: [L, 0, 0]}
  crank: {mass: 1, position: '[cos(th), 5, sin(th)]'}
forces:
  weight: {to: all, force: '[0, 0, -m*g]'}
holonomic:
  rod: norm(a) = L
  plane: a.y = 0
  motor: th = om*t
outputs: {height: 'a.z + L', L2: 'a.x**2'}
simulation: {duration: 2, samples: 101}
"""


@pytest.fixture(scope="module")
def run() -> lagcli.Trajectory:
    return lagcli.simulate(lagcli.loads(MODEL))


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("m.yaml").write_text(MODEL, encoding="utf-8")
    return tmp_path


def table(name: str = "t.csv", /, **columns: object) -> ChartTable:
    rows = np.column_stack([np.asarray(values, dtype=float) for values in columns.values()])
    names = [key.replace("__", ".") for key in columns]
    return chart_table.of_rows(name, names, rows, provenance.NO_FACTS)


def chart(*tables: ChartTable, **choice: object) -> ChartData:
    return compose.chart(tables, compose.chosen(**choice))  # type: ignore[arg-type]


T = np.linspace(0, 10, 501)


# What is drawn.


def test_columns_of_one_kind_and_unit_share_axes_named_with_unit(run: lagcli.Trajectory) -> None:
    drawn = chart(chart_table.of_run(run), y="lambda.*,R.a.z,a.z,a.vx,th,rate(th),energy,height,L2,R.th")
    labels = [" ".join(panel.y_label.split()) for panel in drawn.panels]
    assert labels == [
        *[
            "multipliers λ (N)",
            "multiplier lambda.motor (N·m)",
            "constraint force R.a.z (N)",
            "position a.z (m)",
        ],
        *["velocity a.vx (m/s)", "th (rad)", "rate(th) (rad/s)", "energy (J)", "height, L2", "R.th (N·m)"],
    ]
    assert {panel.x_label for panel in drawn.panels} == {"t  (s)"}
    assert [key.label for key in drawn.panels[0].keys] == ["lambda.rod", "lambda.plane"]
    assert drawn.panels[0].notes == ("zero throughout: lambda.plane",)
    assert drawn.title == "A ball and a pendulum"
    assert np.array_equal(drawn.panels[2].curves[0].y, run["R.a.z"])


def test_without_columns_the_multipliers_are_drawn_and_else_everything() -> None:
    drawn = chart(table(t=T, a=T, lambda__rod=np.sin(T)))
    assert [[c.label for c in panel.curves] for panel in drawn.panels] == [["lambda.rod"]]
    drawn = chart(table(t=T, a=T, b=2 * T))
    assert [[c.label for c in panel.curves] for panel in drawn.panels] == [["a", "b"]]


def test_each_y_has_axes_of_its_own_and_unlike_sizes_are_parted() -> None:
    data = table(t=T, a=T, b=1000 * T, lambda__p=T, lambda__q=1e4 * T)
    parts = [[c.label for c in panel.curves] for panel in chart(data, y=["a,b", "b"]).panels]
    assert parts == [["a"], ["b"], ["b"]]
    assert len(chart(data, y="a,b", is_log=True).panels) == 1


def test_the_other_axis_may_be_any_column_and_paths_have_one_scale(run: lagcli.Trajectory) -> None:
    one = chart_table.of_run(run)
    (plane,) = chart(one, x="a.x", y="a.vx").panels
    assert (plane.shape, " ".join(plane.x_label.split())) == ("plane", "position a.x (m)")
    (rising,) = chart(one, x="th", y="a.x").panels
    assert rising.shape == "time"
    (path,) = chart(one, xy=["a.x,a.z", "crank.x,crank.z"]).panels
    assert path.shape == "equal"
    assert (path.x_label, path.y_label) == ("x  (m)", "z  (m)")
    assert [key.label for key in path.keys] == ["a", "crank"]
    figure = chart_figure.compose(chart(one, xy="a.x,a.z"))
    (plot,) = figure.axes
    box = plot.get_window_extent()
    (x0, x1), (y0, y1) = plot.get_xlim(), plot.get_ylim()
    assert box.width / (x1 - x0) == pytest.approx(box.height / (y1 - y0), rel=1e-6)
    assert x0 < run["a.x"].min() < run["a.x"].max() < x1
    assert y0 < run["a.z"].min() < run["a.z"].max() < y1


def test_a_table_without_t_is_drawn_over_its_rows() -> None:
    (panel,) = chart(table(a=T)).panels
    assert panel.x_label == "row"
    assert panel.curves[0].x[[0, -1]].tolist() == [0, 500]


@pytest.mark.parametrize(
    ("choice", "message"),
    [
        ({"y": "lamda.rod"}, 'no column matches "lamda.rod"; nearest: lambda.rod'),
        ({"x": "T"}, "--x: t.csv has no column `T`; did you mean `t`"),
        ({"xy": "a.x"}, "write two columns"),
        ({"xy": "a.x,a.zz"}, "--xy: there is no column `a.zz`; did you mean `a.z`"),
        ({"xy": "a.x,a.z", "is_log": True}, "one scale"),
        ({"y": [f"c{n}" for n in range(25)]}, "25 panels"),
    ],
)
def test_what_cannot_be_drawn_is_said(choice: dict[str, object], message: str) -> None:
    more = {f"c{n}": T for n in range(25)}
    with pytest.raises(UndrawableColumns) as caught:
        chart(table(t=T, a__x=T, a__z=T, lambda__rod=T, **more), **choice)
    assert message in str(caught.value)


# Expressions of columns.


def drawn_from(*tables: ChartTable, **choice: object) -> ChartData:
    return plot.chart(tables, compose.chosen(**choice))  # type: ignore[arg-type]


def test_expressions_of_columns_are_columns_with_a_name(run: lagcli.Trajectory) -> None:
    one = chart_table.of_run(run)
    y = ["pull=abs(lambda.rod)*L/g", "twice=2*pull", "drift=energy - first(energy)", "th,pull"]
    panels = drawn_from(one, y=y, xy="a.x,twice").panels
    found = {curve.label: curve for panel in panels for curve in panel.curves}
    assert [panel.y_label for panel in panels[:3]] == ["pull", "twice", "drift"]
    assert np.array_equal(found["pull"].y, np.abs(run["lambda.rod"]) * 1.0 / 9.81)
    assert np.array_equal(found["twice"].y, 2 * found["pull"].y)
    assert np.array_equal(found["drift"].y, run["energy"] - run["energy"][0])
    (by_angle,) = drawn_from(one, x="angle=atan2(a.z, a.x)", y="a.vx").panels
    assert (by_angle.x_label, by_angle.shape) == ("angle", "plane")
    assert np.array_equal(by_angle.curves[0].x, np.arctan2(run["a.z"], run["a.x"]))


def test_expressions_hold_their_own_parameters_in_each_run() -> None:
    tables = [
        dataclasses.replace(
            table(f"r{n}.csv", t=T, a__x=T),
            origin={"parameters": {"L": float(n), "u": [1, 2, n], "odd": "x"}},
        )
        for n in (1, 3)
    ]
    (panel,) = drawn_from(*tables, y="size=a.x*L + u.z").panels
    assert [curve.y[-1] for curve in panel.curves] == [11.0, 33.0]
    assert [key.label for key in panel.keys] == ["L = 1, u = [1, 2, 1]", "L = 3, u = [1, 2, 3]"]


def test_a_table_that_lacks_a_column_of_an_expression_goes_without() -> None:
    (panel,) = drawn_from(table("a.csv", t=T, u=T, v=T), table("b.csv", t=T, u=T), y="w=u + v").panels
    assert (len(panel.curves), panel.notes) == (1, ("no column w in b.csv",))


def test_a_table_of_no_rows_and_one_without_time_have_expressions() -> None:
    (panel,) = drawn_from(table(a=T[:0]), y="b=2*a").panels
    assert panel.curves[0].y.size == 0
    (panel,) = drawn_from(table(a=T), y=["b=argmax(a) + 0*a"]).panels
    assert set(panel.curves[0].y) == {500.0}
    (panel,) = drawn_from(table(t=T, a=T), y=["c=1.5"]).panels
    assert set(panel.curves[0].y) == {1.5}


@pytest.mark.parametrize(
    ("choice", "message"),
    [
        (
            {"y": "q=lambda.rodd"},
            "--y q: `lambda.rodd` is neither a column of the table nor a parameter; did you mean",
        ),
        ({"y": "2=a.x"}, "write NAME=EXPR"),
        ({"y": "q="}, "write NAME=EXPR"),
        ({"y": "a.q=a.x"}, "write NAME=EXPR"),
        ({"y": "t=a.x"}, "has a column `t` of its own"),
        ({"y": ["q=a.x", "q=a.z"]}, "has a column `q` of its own"),
        ({"y": "q=a.x +"}, "--y q: the expression ends after `+`"),
        ({"x": "q=[1, 2, 3]", "y": "a.x"}, "--x q: a scalar is needed"),
        ({"y": "q=" + "(" * 5000 + "a.x" + ")" * 5000}, "--y q: "),
        ({"y": "q=9**9**9**9*b.x"}, "--y q: "),
    ],
)
def test_an_expression_that_is_none_is_said(choice: dict[str, object], message: str) -> None:
    with pytest.raises(UndrawableColumns) as caught:
        drawn_from(table(t=T, a__x=T, a__z=T, lambda__rod=T), **choice)
    assert message in str(caught.value)


# Zero, noise, sizes.


def test_what_is_zero_to_rounding_is_drawn_as_zero() -> None:
    noise = 1e-16 * np.sin(99 * T)
    (panel,) = chart(table(t=T, lambda__a=5 + np.sin(T), lambda__b=noise, lambda__c=0 * T)).panels
    assert not panel.curves[1].y.any()
    assert panel.notes == ("zero to rounding: lambda.b", "zero throughout: lambda.c")
    (alone,) = chart(table(t=T, lambda__b=noise)).panels
    assert "may be zero to rounding" in alone.notes[0]


def test_an_output_that_may_be_zero_to_rounding_is_said_where_a_model_is_reported() -> None:
    """Outputs have any size: they are drawn as they are, and tables of others are left without a word."""
    noise = 1e-16 * np.sin(99 * T)
    rows = np.column_stack([T, noise])
    told = provenance.TableFacts(units=provenance.Units())
    (panel,) = chart(chart_table.of_rows("t.json", ["t", "slip"], rows, told)).panels
    assert panel.curves[0].y.any()
    assert panel.notes == ("no value is larger than 1.0e-16: these may be zero to rounding",)
    assert chart(table(t=T, slip=noise)).panels[0].notes == ()


BALL = """\
lagcli: 1
parameters: {m: 1, R: 0.1}
coordinates: {x: {rate: 1}, th: {rate: 10}}
lagrangian: m/2*rate(x)**2 + m*R**2/5*rate(th)**2
differential: {roll: d(x) - R*d(th) = 0}
simulation: {duration: 1, samples: 11}
"""


def test_of_a_model_rounding_is_known_even_where_nothing_else_acts(here: Path, command) -> None:
    made = lagcli.simulate(lagcli.loads(BALL))
    noisy = lagcli.Trajectory(
        made.columns, made.rows + (np.array(made.columns) == "lambda.roll") * 1e-17, made.stats,
        zeros=frozenset({"lambda.roll"}),
    )  # fmt: skip
    (panel,) = chart(chart_table.of_run(noisy)).panels
    assert not panel.curves[0].y.any()
    assert panel.notes == ("zero to rounding: lambda.roll",)
    assert made.zeros is not None


def test_logarithmic_sizes_say_what_they_leave_out() -> None:
    values = np.where(np.arange(501) % 5 == 0, 0.0, np.exp(-3 * T) * np.cos(T))
    (panel,) = chart(table(t=T, err__r=values, err__v=0 * T), is_log=True).panels
    assert panel.notes == (
        "sizes are drawn; negative values occur in err.r",
        "exactly zero throughout, not drawn: err.v",
        "gaps where values are exactly zero: err.r (101 of 501)",
    )
    assert panel.y_label == "size of errors"
    assert np.nanmin(panel.curves[0].y) > 0
    figure = chart_figure.compose(ChartData("", (panel,)))
    assert figure.axes[0].get_yscale() == "log"
    low, high = figure.axes[0].get_ylim()
    assert low <= np.nanmin(panel.curves[0].y)
    assert high >= 1


@pytest.mark.parametrize("size", [5e-324, 1e-300, 1e-12, 1.0, 1e15, 1e300])
@pytest.mark.parametrize("is_log", [False, True])
def test_values_of_any_size_can_be_drawn(size: float, is_log: bool, tmp_path: Path) -> None:
    data = table(t=T, a__x=size * np.sin(T), a__z=size * np.cos(T), a__vx=T)
    figure_page.write(tmp_path / "a.png", chart_figure.compose(chart(data, y="a.x,a.z", is_log=is_log)))
    found = chart(data, xy="a.x,a.z") if not is_log else chart(data, y="a.x", x="a.z", is_log=True)
    figure_page.write(tmp_path / "a.png", chart_figure.compose(found))
    assert list(chart_terminal.lines(found, chart_terminal.TerminalLook()))


@pytest.mark.parametrize("count", [0, 1, 2])
def test_tables_of_few_rows_can_be_drawn(count: int, tmp_path: Path) -> None:
    for many in (1, 40):
        data = table(t=T[:count], **{f"lambda__c{n}": T[:count] for n in range(many)})
        for found in (
            chart(data),
            chart(data, is_log=True),
            chart(data, xy="t,lambda.c0"),
            chart(data, x="lambda.c0"),
        ):
            figure_page.write(tmp_path / "a.svg", chart_figure.compose(found))
            assert list(chart_terminal.lines(found, chart_terminal.TerminalLook()))


def test_gaps_stay_gaps() -> None:
    y = np.where((T > 3) & (T < 4), np.nan, T)
    (panel,) = chart(table(t=T, a=y)).panels
    assert np.isnan(panel.curves[0].y).any()
    everywhere = np.where(np.arange(100_000) % 2, np.nan, 1.0)
    (panel,) = chart(table(t=np.arange(1e5), a=everywhere)).panels
    assert len(panel.curves[0].y) < 10_000


def test_thinning_keeps_extrema_of_columns_read_in_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(1)
    columns = {f"c{n}": rng.standard_normal(50_000) for n in range(5)}
    for n, values in enumerate(columns.values()):
        values[7_777 * (n + 1)] = 50.0
    monkeypatch.setattr(chart_table, "BATCH", 150_000)
    (panel,) = chart(table(t=np.arange(50_000), **columns), y="c*").panels
    for n, curve in enumerate(panel.curves):
        assert len(curve.x) <= chart_table.MOST + 2
        assert curve.x[curve.y.argmax()] == 7_777 * (n + 1)


def test_an_orbit_that_repeats_is_drawn_once_and_noise_is_bounded() -> None:
    t = np.linspace(0, 2000 * np.pi, 400_000)
    x, y = path_drawn(np.cos(t), np.sin(t), most=5000)
    assert len(x) < 12_000
    known = np.isfinite(x)
    assert np.allclose(np.hypot(x, y)[known], 1)
    angles = np.sort(np.arctan2(y[known], x[known]))
    assert np.diff(angles).max() < 0.02
    rng = np.random.default_rng(2)
    noise = rng.standard_normal((2, 100_000))
    x, _ = path_drawn(*noise, most=5000)
    assert 4000 < len(x) < 20_000
    broken = np.where(np.arange(400_000) == 200_000, np.nan, np.cos(t))
    assert np.isnan(path_drawn(broken, t)[0]).any()


# Several runs.


def test_runs_are_named_by_the_parameters_that_differ() -> None:
    paths = ["a/run.npz", "b/run.npz"]
    told = [{"parameters": {"L": size, "m": 1.0}, "rtol": 1e-9} for size in (0.5, 2.0)]
    assert labels.distinguishing(paths, told) == ["L = 0.5", "L = 2"]
    assert labels.distinguishing(paths, [told[0], told[0]]) == ["a", "b"]
    assert labels.distinguishing(paths, [told[0], told[0] | {"rtol": 1e-6}]) == [
        "rtol = 1e-09",
        "rtol = 1e-06",
    ]
    assert labels.distinguishing(paths, [told[0], None]) == ["a", "b"]
    # Of one model, parameters that follow from those that were set are not told.
    follows = [{"sha256": "1", "parameters": {"L": x, "M": 2 * x}, "set": {"L": str(x)}} for x in (1.0, 3.0)]
    assert labels.distinguishing(paths, follows) == ["L = 1", "L = 3"]
    follows[0] |= {"set": {}}
    assert labels.distinguishing(paths, follows) == ["L = 1", "L = 3"]
    follows[1] |= {"sha256": "2"}
    assert labels.distinguishing(paths, follows) == ["L = 1, M = 2", "L = 3, M = 6"]


@pytest.mark.parametrize(
    ("paths", "names"),
    [
        (["one.csv"], [""]),
        (["runs/L-0.5.csv", "runs/L-1.5.csv"], ["L-0.5", "L-1.5"]),
        (["run_m1_x.csv", "run_m2_x.csv"], ["m1", "m2"]),
        (["a.csv", "a.json"], ["a.csv", "a.json"]),
        (["x/a/t.csv", "x/b/c/t.csv"], ["a", "b/c"]),
        (["a.csv", "a.csv"], ["a.csv (1)", "a.csv (2)"]),
        (["", ""], ["run 1", "run 2"]),
        (["run.csv", "run_2.csv"], ["run", "run_2"]),
    ],
)
def test_names_of_files_are_shortened_to_what_differs(paths: list[str], names: list[str]) -> None:
    assert labels.distinguishing(paths, [None] * len(paths)) == names


def test_overlays_tell_columns_by_colour_and_runs_by_dashes() -> None:
    tables = [table(f"r{n}.csv", t=T, a__x=n * T, a__z=-n * T, a__vx=T) for n in (1, 2, 3)]
    (panel,) = chart(*tables, y="a.x,a.z").panels
    assert [(key.label, key.colour, key.dash) for key in panel.keys] == [
        ("a.x", 0, 0), ("a.z", 1, 0), ("r1", None, 0), ("r2", None, 1), ("r3", None, 2),
    ]  # fmt: skip
    (single,) = chart(*tables, y="a.x").panels
    assert [key.label for key in single.keys] == ["r1", "r2", "r3"]
    many = [table(f"r{n}.csv", t=T, a__x=n * T, a__z=-n * T, a__vx=T) for n in range(30)]
    assert [(len(p.curves), p.is_family) for p in chart(*many, y="a.x,a.z").panels] == [
        (30, True),
        (30, True),
    ]


def test_a_column_that_one_table_lacks_is_said() -> None:
    (panel,) = chart(table("a.csv", t=T, u=T, v=T), table("b.csv", t=T, u=T), y="v").panels
    assert panel.notes == ("no column v in b.csv",)
    assert len(panel.curves) == 1


# Texts and figures.


def test_lines_of_a_dozen_curves_all_differ() -> None:
    looks = {(c.colour % 6, (c.dash + c.dash // 6) % 6) for c in chart(table(t=T, **{f"c{n}": T for n in range(12)}))
             .panels[0].curves}  # fmt: skip
    assert len(looks) == 12


@pytest.mark.parametrize("many", [1, 3, 12, 100])
def test_strangers_names_are_drawn_to_the_letter_within_the_page(many: int, tmp_path: Path) -> None:
    names = [f"{AWKWARD[n % len(AWKWARD)]}{n}" for n in range(many)]
    rows = np.column_stack([T, *(np.sin(T + n) for n in range(many))])
    title = "\x1b[31m$\\alpha$ <b>&amp; \u202eabc עברית " + "word " * 400
    data = chart_table.of_rows("t.csv", ["t", *names], rows, provenance.NO_FACTS)
    drawn = chart(data, title=title)
    figure = chart_figure.compose(drawn)
    shown = texts(figure)
    assert all(not text.get_parse_math() for text in shown)
    for text in shown:
        box = text.get_window_extent()
        assert figure.bbox.x0 <= box.x0, text
        assert box.x1 <= figure.bbox.x1, text
        assert figure.bbox.y0 <= box.y0, text
        assert box.y1 <= figure.bbox.y1, text
    joined = "".join("".join(text.get_text().split()) for text in shown)
    assert "$\\alpha$<b>&amp;" in joined
    assert "\x1b" not in joined
    assert "\u202e" not in joined
    figure_page.write(tmp_path / "a.svg", chart_figure.compose(drawn))
    xml.etree.ElementTree.parse(tmp_path / "a.svg")
    lines = list(chart_terminal.lines(drawn, chart_terminal.TerminalLook(80)))
    assert not any("\x1b" in line or "\u202e" in line for line in lines)
    assert max(map(diagnostics.columns, lines)) <= 80


@pytest.mark.parametrize("fmt", ["png", "svg", "pdf"])
def test_equal_charts_give_equal_bytes(fmt: str, here: Path, command) -> None:
    for name in ("a", "b"):
        arguments = ["--y", "lambda.*", "--xy", "a.x,a.z", "-o", f"{name}.{fmt}"]
        assert command("plot", "m.yaml", *arguments) == ("", "", 0)
    assert Path(f"a.{fmt}").read_bytes() == Path(f"b.{fmt}").read_bytes()
    assert Path(f"a.{fmt}").read_bytes().startswith({"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}[fmt])


# In the terminal.


def test_a_terminal_shows_curves_ticks_and_names() -> None:
    data = table(t=T, lambda__rod=2 * np.sin(T), lambda__wire=np.cos(T))
    lines = list(chart_terminal.lines(chart(data), chart_terminal.TerminalLook(60)))
    assert lines[0] == "t.csv"
    assert lines[2] == "multipliers λ"
    assert "a lambda.rod   b lambda.wire" in lines
    assert any(line.startswith((" 2", "-2")) for line in lines)
    assert max(map(len, lines)) <= 60
    assert any(line.split() == ["0.0", "2.5", "5.0", "7.5", "10.0"] for line in lines)
    body = "".join(lines)
    assert sum("\u2800" < letter <= "\u28ff" for letter in body) > 100


def test_a_curve_in_the_terminal_is_where_its_values_are() -> None:
    lines = list(chart_terminal.lines(chart(table(t=T, a=T)), chart_terminal.TerminalLook(60)))
    rows = [line for line in lines if "│" in line or "┤" in line]
    first = [next(place for place, letter in enumerate(row) if "\u2800" < letter <= "\u28ff") for row in rows]
    assert first == sorted(first, reverse=True)
    assert len(set(first)) == len(rows)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("rows", "options"),
    [
        ("1e17,1,2", ()),  # 0.5 more or less is the same instant
        ("1e17,1,2\n100000000000000016,4,2", ("--log",)),
        ("0,1e17,1\n1,1e17,2", ("--x", "a", "--y", "b")),
        ("0,0,0\n1,1e-310,1\n2,2e-310,3", ("--xy", "a,b")),  # the ratio of the extents is no double
        ("0,-1e308,1\n1,1e308,2", ()),  # nor is the difference
        ("0,-1e308,1\n1,1e308,2", ("--xy", "a,b")),
    ],
)
def test_any_doubles_are_drawn(here: Path, rows: str, options: tuple[str, ...]) -> None:
    Path("t.csv").write_text(f"t,a,b\n{rows}\n", encoding="utf-8")
    for target in (("--show",), ("-o", "t.svg")):
        _, err, code = in_process.run("plot", "t.csv", *options, *target)
        assert (code, err.count("bug")) == (0, 0), err
    assert Path("t.svg").stat().st_size > 5000


def test_colours_of_a_terminal_are_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    data = chart(table(t=T, a=T, b=-T))
    plain = list(chart_terminal.lines(data, chart_terminal.TerminalLook(60)))
    assert "\x1b" not in "".join(plain)
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.delenv("NO_COLOR", raising=False)
    coloured = list(chart_terminal.lines(data, chart_terminal.TerminalLook(60, has_colours=True)))
    assert "\x1b[38;5;25m" in "".join(coloured)


def test_ticks_are_round_and_differ() -> None:
    assert chart_terminal.ticks(0, 10, 5) == [(0, "0"), (2, "2"), (4, "4"), (6, "6"), (8, "8"), (10, "10")]
    rng = np.random.default_rng(4)
    for _ in range(500):
        low = rng.standard_normal() * 10.0 ** rng.integers(-12, 12)
        span = abs(rng.standard_normal()) * 10.0 ** rng.integers(-6, 12) * max(abs(low), 1e-9)
        found = chart_terminal.ticks(low, low + span, 5)
        assert len({text for _, text in found}) == len(found)
        assert all(low - 1e-6 * span <= value <= low + span * (1 + 1e-6) for value, _ in found)


# The command.


def test_tables_of_every_format_give_one_figure(here: Path, command) -> None:
    figures = []
    for ending in ("csv", "tsv", "json", "npz", "parquet"):
        assert command("simulate", "m.yaml", "-q", "-o", f"run.{ending}")[2] == 0
        options = ["--y", "lambda.*,a.?", "--title", "same", "-o", "x.svg"]
        assert command("plot", f"run.{ending}", *options) == ("", "", 0)
        figures.append(Path("x.svg").read_text())
    assert figures[0] == figures[1]
    assert figures[2] == figures[3] == figures[4]
    assert figures[0] != figures[2]  # CSV has no place for units


def test_provenance_brings_units_and_title(here: Path) -> None:
    lagcli.simulate(lagcli.load("m.yaml"))
    in_process.run("simulate", "m.yaml", "-q", "-o", "run.json")
    drawn = chart(chart_table.of_file("run.json"), y="lambda.rod,lambda.motor")
    assert drawn.title == "A ball and a pendulum"
    assert [" ".join(panel.y_label.split()) for panel in drawn.panels] == [
        "multiplier lambda.rod (N)", "multiplier lambda.motor (N·m)",
    ]  # fmt: skip


@pytest.mark.parametrize(
    "origin",
    [
        {"title": 7, "units": [], "dimensions": "x"},
        {"units": {"length": 1, "mass": "kg", "time": "s"}},
        {
            "dimensions": {
                "lengths": {"rod": "1", "b": 1e300, "c": 1},
                "angles": [1, "th"],
                "positions": {"a": 1},
            }
        },
        {"parameters": [1], "rtol": [[1]]},
    ],
)
def test_a_strangers_provenance_tells_what_it_can(origin: dict[str, object]) -> None:
    facts = provenance.facts_from(origin)
    assert facts.units is None
    assert facts.dimensions.lengths in ({}, {"c": 1.0})
    labels.distinguishing(["a", "b"], [origin, origin])


def test_standard_input_is_a_table(here: Path, command, monkeypatch: pytest.MonkeyPatch) -> None:
    for text, code in (("t,lambda.rod\n0,1\n1,2\n", 0), ("t,lambda.rod\n0,1\n1,x\n", 2), ("", 2)):
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(text.encode())))
        out, err, found = command("plot", "-", "--show")
        assert found == code, err
        assert ("multiplier lambda.rod" in out) == (code == 0)
        assert "lagcli-" not in err
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"t,lambda.rod\n0,1\n1,x\n")))
    assert "<stdin> is no table in the format .csv: row 2" in command("plot", "-", "--show")[1]


def test_a_model_is_simulated_with_the_options(here: Path, command) -> None:
    out, err, code = command("plot", "m.yaml", "--y", "a.x", "--duration", "1", "--set", "L=3", "--show")
    assert (err, code) == ("", 0)
    assert "position a.x (m)" in out
    assert "3" in out
    ticks = out.splitlines()[-2].split()
    assert (ticks[0], ticks[-1]) == ("0.0", "1.0")


def test_a_run_begins_at_the_row_of_a_table(here: Path, command) -> None:
    Path("free.yaml").write_text(MODEL.replace("  motor: th = om*t\n", ""), encoding="utf-8")
    assert command("simulate", "free.yaml", "-q", "-o", "run.npz")[2] == 0
    options = ["--from", "run.npz:50", "--duration", "1", "--max-step", "0.1"]
    figure = ["--y", "a.x,a.vx", "--title", "same"]
    assert command("plot", "free.yaml", *options, *figure, "-o", "half.svg") == ("", "", 0)
    assert command("simulate", "free.yaml", *options, "-q", "-o", "half.npz")[2] == 0
    assert np.load("half.npz")["a.x"][0] == np.load("run.npz")["a.x"][50]
    assert command("plot", "half.npz", *figure, "-o", "table.svg") == ("", "", 0)
    assert Path("half.svg").read_bytes() == Path("table.svg").read_bytes()


def test_a_watched_figure_follows_its_table(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Drawn at once, again where table or events change, and still there after a table that is none."""
    Path("t.csv").write_text("t,lambda.rod\n0,1\n1,2\n")
    drawn: list[bytes] = []
    texts = ["t,lambda.rod\n0,1\n1,5\n", "", "t;x\n", "", "t,lambda.rod\n0,1\n1,2\n2,0\n", ""]

    def pause() -> None:
        drawn.append(Path("x.svg").read_bytes())
        if not texts:
            raise exits.Exit(0)
        if text := texts.pop(0):  # then it stays as it is for a moment
            Path("t.csv").write_text(text)

    monkeypatch.setattr(options, "follow", functools.partial(options.follow, pause=pause))
    _, err, code = in_process.run("plot", "t.csv", "-o", "x.svg", "--watch")
    assert code == 0
    assert "is no table in the format .csv" in err
    assert err.count("watching t.csv") >= 3
    assert len(set(drawn)) == 3


STOPPING = """\
lagcli: 1
particles: {a: {mass: 1, position: [1, 0, 0], velocity: [-1, 0, -0.5]}}
holonomic: {wall: a.z = sqrt(a.x) - 1}
simulation: {duration: 2, samples: 21}
"""


def test_a_run_that_stops_is_drawn_as_far_as_it_went(here: Path, command) -> None:
    Path("s.yaml").write_text(STOPPING, encoding="utf-8")
    out, err, code = command("plot", "s.yaml", "--y", "a.x", "--show")
    assert code == 3
    assert "position a.x" in out
    assert err.startswith("lagcli: ")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["m.yaml"], "nothing to draw on: give -o FILE.png (svg, pdf), or --show"),
        (["missing.csv", "--show"], "there is no file missing.csv"),
        (["t.csv", "-o", "x.gif"], "unknown format"),
        (["t.csv", "-o", "-"], "unknown format"),
        (["t.csv", "--show", "--duration", "1"], "--duration is for a MODEL that is simulated"),
        (["t.csv", "--show", "--set", "m=1"], "--set is for a MODEL that is simulated"),
        (["t.csv", "--show", "--max-step", "1"], "--max-step is for a MODEL that is simulated"),
        (["t.csv", "--show", "--from", "t.csv"], "--from is for a MODEL that is simulated"),
        (["m.yaml", "--show", "--from", "none.csv"], "--from: there is no file none.csv"),
        (["m.yaml", "--show", "--max-step", "-1"], "max_step"),
        (["-", "--show", "--watch"], "--watch needs a file"),
        (["t.csv", "--show", "--y", "q=b"], "--y q: `b` is neither a column of the table nor a parameter"),
        (["t.csv", "--show", "--y", "q"], 'no column matches "q"'),
        (["t.csv", "--show", "--events", "nothing.csv"], "--events: there is no file"),
        (["t.csv", "--show", "--events", "t.csv"], "is no table of events"),
        (["m.yaml", "--show", "--samples", "-1"], "samples"),
        (["bad.csv", "--show"], "is no table in the format .csv"),
        (["-", "-", "--show"], "standard input can be read once only"),
    ],
)
def test_what_a_command_line_lacks_is_said(here: Path, command, arguments: list[str], message: str) -> None:
    Path("t.csv").write_text("t,lambda.rod\n0,1\n1,2\n")
    Path("bad.csv").write_text("t;lambda.rod\n0;1\n1;2\n")
    out, err, code = command("plot", *arguments)
    assert (out, code) == ("", 2)
    assert message in err


def test_a_figure_does_not_write_over_a_table(here: Path, command) -> None:
    Path("t.csv").write_text("t,lambda.rod\n0,1\n")
    Path("link.png").symlink_to("t.csv")
    assert command("plot", "t.csv", "-o", "link.png")[2] == 2
    assert Path("t.csv").read_text().startswith("t,")


BOUNCING = """\
lagcli: 1
parameters: {g: 10}
particles: {a: {mass: 1, position: [0, 0, 1], velocity: [1, 0, 0]}}
forces: {weight: {to: a, force: '[0, 0, -m*g]'}}
inequality: {floor: {condition: a.z >= 0, restitution: 0.5}}
simulation: {duration: 1, samples: 11}
"""


def test_incidents_are_marked_and_jumps_stand_upright(here: Path, command) -> None:
    Path("b.yaml").write_text(BOUNCING, encoding="utf-8")
    run = lagcli.simulate("b.yaml", event_rows=True)
    drawn = chart(chart_table.of_run(run), y="a.vz", xy="a.x,a.z")
    assert [kind for _, kind in drawn.incidents] == ["impact", "impact"]
    over_time, path = drawn.panels
    at = [k for k, x in enumerate(over_time.curves[0].x) if x == run.events.t[0]]
    assert over_time.curves[0].y[at].tolist() == pytest.approx([-np.sqrt(20), np.sqrt(5)])
    (dots,) = path.dots
    assert dots.x.tolist() == pytest.approx(run.events.t.tolist())
    assert dots.y.tolist() == pytest.approx([0, 0], abs=1e-9)
    command("simulate", "b.yaml", "-q", "-o", "run.csv", "--events", "events.csv")
    out, _, code = command("plot", "run.csv", "--y", "a.z", "--events", "events.csv", "--show")
    assert code == 0
    assert "┆ 2 × impact" in out
    assert "impact" not in command("plot", "run.csv", "--y", "a.z", "--show")[0]


def test_python_draws_the_same(run: lagcli.Trajectory, here: Path, command) -> None:
    figure = run.plot("lambda.*", xy="a.x,a.z", path="a.svg")
    assert len(figure.axes) == 3
    again = lagcli.plot("m.yaml", y="lambda.*", xy="a.x,a.z", path="b.svg")
    assert [plot.get_ylabel() for plot in again.axes] == [plot.get_ylabel() for plot in figure.axes]
    assert command("plot", "m.yaml", "--y", "lambda.*", "--xy", "a.x,a.z", "-o", "c.svg")[2] == 0
    assert Path("a.svg").read_bytes() == Path("b.svg").read_bytes() == Path("c.svg").read_bytes()
    assert figure._repr_png_().startswith(b"\x89PNG")
    with pytest.raises(ValueError, match="nothing to plot"):
        lagcli.plot()
    two = lagcli.plot(run, lagcli.loads(MODEL, parameters={"L": 2}), y="a.x")
    assert any("L = 2" in text.get_text() for text in texts(two))


PAGE = (Path(__file__).parents[2] / "docs" / "how-to" / "plot-anything.md").read_text(encoding="utf-8")


def test_the_page_on_plots_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its lines one after the other, the gallery beside them; a pipe is taken apart."""
    shutil.copytree(Path(__file__).parents[2] / "models", tmp_path / "models")
    monkeypatch.chdir(tmp_path)
    lines = [line for body in re.findall(r"```sh\n(.*?)```", PAGE, re.DOTALL) for line in body.splitlines()]
    assert len(lines) > 15
    for line in lines:
        left, _, right = line.partition(" | ")
        out, err, code = in_process.run(*shlex.split(left)[1:])
        if right:
            monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(out.encode())))
            out, err, code = in_process.run(*shlex.split(right)[1:])
        assert code == 0, (line, err)
        for name in re.findall(r"-o (\S+)", line):
            assert Path(name).stat().st_size > 1000
    (python,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    exec(compile(python, "plot-anything.md", "exec"), {})
    assert Path("both.png").stat().st_size > 1000
