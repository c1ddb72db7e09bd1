"""Figures: every curve and every word of the user's is there, whatever the model and its names."""

import dataclasses
import itertools
import re
import subprocess
import sys
import xml.etree.ElementTree
from collections.abc import Sequence
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from matplotlib import figure as mpl_figure
from matplotlib import text as mpl_text
from matplotlib.backends import backend_agg
from numpy.typing import NDArray

from lagcli.output.figures import chart, chart_figure, figure_page, labels, panels
from lagcli.output.files import formats


@dataclasses.dataclass(frozen=True)
class Labels:
    length: str = "m"
    mass: str = "kg"
    time: str = "s"


AWKWARD = [
    "$x^2$ {broken \\frac{",
    "a_b<c>&amp;--",
    "größe_λ_ж",
    "振り子",
    "x" * 120,
    "the longest name that one would ever think of giving to a constraint of a small mechanism",
    "$",
    "\\",
    "link[1][2]",
]


def run(
    constraints: Sequence[str], particles: Sequence[str], count: int = 200, coordinates: Sequence[str] = ()
) -> tuple[list[str], NDArray[np.float64]]:
    t = np.linspace(0.0, 10.0, count)
    columns = {"t": t}
    for place, name in enumerate(constraints):
        columns[f"lambda.{name}"] = 0 * t if place == 2 else np.sin((1 + 0.1 * place) * t) + place % 3
    for place, name in enumerate(particles):
        for axis, size in zip("xyz", (1.0, 0.0, 9.81), strict=True):
            columns[f"R.{name}.{axis}"] = (place != 1) * (size + size * np.cos(t + place))
    for name in coordinates:
        columns[f"R.{name}"] = np.sin(t)
    return list(columns), np.stack(list(columns.values()), axis=1)


def names(stem: str, count: int) -> list[str]:
    return [f"{stem}[{number}]" for number in range(1, count + 1)]


def compose(
    columns: list[str], rows: NDArray[np.float64], title: str = "A title", units: Labels | None = None
) -> mpl_figure.Figure:
    return chart_figure.compose_run(columns, rows, title=title, units=units or Labels())


def draw(
    path: Path, columns: list[str], rows: NDArray[np.float64], title: str, units: Labels | None = None
) -> None:
    figure_page.write(path, compose(columns, rows, title, units))


def texts(drawn: mpl_figure.Figure) -> list[mpl_text.Text]:
    backend_agg.FigureCanvasAgg(drawn).draw()
    found = drawn.findobj(lambda artist: isinstance(artist, mpl_text.Text))
    return [
        text
        for text in found
        if isinstance(text, mpl_text.Text) and text.get_visible() and text.get_text().strip()
    ]


def words(drawn: mpl_figure.Figure) -> str:
    return "".join("".join(text.get_text().split()) for text in texts(drawn))


CASES = {
    "one": run(["rod"], ["bob"]),
    "four": run(["rod", "ramp_a", "stick", "floor"], ["upper", "lower", "cart"]),
    "forty": run(names("link", 40), names("p", 12)),
    "fifty-one": run(names("link", 51), names("p", 13)),
    "two hundred": run(names("link", 200), names("p", 200)),
    "coordinates": run(names("row", 7), [], coordinates=["theta", "phi"]),
    "many coordinates": run([], [], coordinates=names("q", 20)),
    "no constraints": run([], ["a", "b"]),
    "nothing at all": run([], []),
    "awkward": run(AWKWARD, AWKWARD),
    "awkward family": run([f"{name}{number}" for number in range(7) for name in AWKWARD], ["a"]),
    "one row": run(["rod", "wire"], ["a"], count=1),
    "one row of many": run(names("link", 60), names("p", 60), count=1),
    "no row": run(["rod"], ["a"], count=0),
    "no row of many": run(names("link", 60), names("p", 60), count=0),
}


@pytest.mark.parametrize("case", CASES)
def test_no_text_leaves_the_page_or_lies_on_something_else(case: str) -> None:
    drawn = compose(*CASES[case], title="A title $with $ {braces} " + 20 * "and many words ")
    boxes = [(text.get_text(), text.get_window_extent()) for text in texts(drawn)]
    page = drawn.bbox
    for text, box in boxes:
        assert page.x0 <= box.x0, text
        assert box.x1 <= page.x1, text
        assert page.y0 <= box.y0, text
        assert box.y1 <= page.y1, text
    for (first, one), (second, other) in itertools.combinations(boxes, 2):
        apart = one.padded(-1.5), other.padded(-1.5)
        assert not apart[0].overlaps(apart[1]), (first, second)
    for plot, text in itertools.product(drawn.axes, drawn.texts):
        box = text.get_window_extent().padded(-1.5)
        assert not plot.get_window_extent().overlaps(box), text.get_text()


def test_a_long_title_above_axes_that_matplotlib_lays_out_is_broken_into_lines() -> None:
    with figure_page.style():
        drawn = figure_page.sheet("A title $with $ {braces} " + 10 * "and many words ", 4.0)
        plot = drawn.subplots()
        plot.set_ylabel("the name of a check\n(not judged)", rotation=0, ha="right")
    boxes = {text.get_text(): text.get_window_extent() for text in texts(drawn)}
    (title,) = (text for text in boxes if "title" in text)
    assert title.count("\n") == 2
    assert boxes[title].y0 > plot.get_window_extent().y1
    assert all(box.x0 >= 0 and box.x1 <= drawn.bbox.x1 and box.y0 >= 0 for box in boxes.values())
    assert max(box.y1 for box in boxes.values()) <= drawn.bbox.y1


@pytest.mark.parametrize("fmt", formats.FIGURES)
def test_equal_runs_give_equal_files(tmp_path: Path, fmt: str) -> None:
    for name in ("a", "b"):
        draw(tmp_path / f"{name}.{fmt}", *CASES["one row of many"], title="$ {", units=Labels())
    content = (tmp_path / f"a.{fmt}").read_bytes()
    assert content.startswith({"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}[fmt])
    assert len(content) > 8_000
    assert content == (tmp_path / f"b.{fmt}").read_bytes()
    assert len(list(tmp_path.iterdir())) == 2


@pytest.mark.parametrize("fmt", formats.FIGURES)
def test_awkward_texts_can_be_written_in_every_format(tmp_path: Path, fmt: str) -> None:
    path = tmp_path / f"a.{fmt}"
    draw(path, *CASES["awkward"], title="振り子 $ { \x07 ]]> -->", units=Labels("$l$", "a_b", "{"))
    if fmt == "svg":
        xml.etree.ElementTree.parse(path)
    assert path.stat().st_size > 8_000


def test_names_and_titles_are_shown_to_the_letter() -> None:
    columns, rows = CASES["awkward"]
    shown = words(
        compose(columns, rows, title="$\\alpha_{ } < & 100% \\begin{x}$", units=Labels("$l$", "a_b", "{"))
    )
    assert "$\\alpha_{}<&100%\\begin{x}$" in shown
    assert "t({)" in shown
    assert "Rₖ((a_b)($l$)/({)²)" in shown
    for name in AWKWARD:
        if name.isascii():
            assert shown.count("".join(name.split())) >= 2 if name != AWKWARD[0] else name.split()[0] in shown
    assert all(not text.get_parse_math() for text in texts(compose(columns, rows)))


def test_a_letter_that_no_font_has_is_shown_by_its_code(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(figure_page, "FALLBACK_FONTS", ())
    assert "\\u632f\\u308a\\u5b50" in words(compose(*run(["振り子"], [])))
    assert "größe_λ_ж" in words(compose(*run(["größe_λ_ж"], [])))


def test_every_multiplier_is_drawn_zero_or_not() -> None:
    for count in (1, 3, 7, 40, 200):
        columns, rows = run(names("link", count), [])
        (band,) = panels.bands(columns, rows, Labels())
        labels = [panel.title or curve.label for panel in band.panels for curve in panel.curves]
        assert labels == names("link", count)
        assert band.panels[0].is_family == (count > 50)


def test_multipliers_of_unlike_size_do_not_share_axes() -> None:
    columns, rows = run(["a", "b"], [])
    assert len(panels.bands(columns, rows, Labels())[0].panels) == 1
    rows[:, 2] *= 1e3
    assert len(panels.bands(columns, rows, Labels())[0].panels) == 2


def test_particles_without_constraint_force_are_named_instead_of_drawn() -> None:
    columns, rows = run(["rod"], ["a", "idle", "c"])
    rows[3, columns.index("R.idle.x")] = 1e-17  # round-off
    band = panels.bands(columns, rows, Labels())[1]
    assert [panel.title for panel in band.panels] == ["a", "c"]
    assert band.note == "zero throughout: idle"
    assert [curve.label for curve in band.panels[0].curves] == ["x component", "y component", "z component"]


def test_many_particles_are_drawn_as_sizes_of_force() -> None:
    columns, rows = run([], names("p", 20))
    band = panels.bands(columns, rows, Labels())[1]
    (panel,) = band.panels
    assert panel.is_family
    assert panel.y_label == "|Rₖ|  (N)"
    assert len(panel.curves) == 19
    force = rows[:, [columns.index(f"R.p[1].{axis}") for axis in "xyz"]]
    assert np.allclose(panel.curves[0].y, np.sqrt((force**2).sum(axis=1)), rtol=1e-15, atol=0)


def test_units_stand_on_the_axes() -> None:
    assert labels.force_unit(Labels()) == "N"
    assert [labels.force_unit(Labels(), p) for p in (2, 0, -1, 4)] == ["N·m", "N/m", "N/m²", "N·m³"]
    assert labels.force_unit(Labels("cm", "g", "s")) == "g cm/s²"
    assert labels.force_unit(Labels("cm", "g", "s"), 2) == "g cm²/s²"
    assert labels.force_unit(Labels("cm", "g", "s"), -1) == "g/s²/cm"
    assert labels.force_unit(Labels("", "", "")) == ""
    assert labels.force_unit(Labels("", "", "s")) == "1/s²"
    assert labels.force_unit(Labels("nautical mile", "kg", "h"), 2) == "kg (nautical mile)²/h²"
    shown = words(compose(*CASES["four"], units=Labels("cm", "g", "ms")))
    assert "t(ms)" in shown
    assert "λᵢ(gcm²/ms²/unitoffᵢ)" in shown
    assert "Rₖ(gcm/ms²)" in shown


def test_thinning_keeps_ends_and_extrema() -> None:
    rng = np.random.default_rng(3)
    values = rng.standard_normal(100_003)
    values[77_777] = 50.0
    values[12_345] = -50.0
    kept = chart.extrema(values, 2000)
    assert len(kept) <= 2002
    assert {0, 12_345, 77_777, 100_002} <= set(kept.tolist())
    assert (np.diff(kept) > 0).all()
    assert chart.extrema(values[:5], 2000).tolist() == [0, 1, 2, 3, 4]
    assert chart.extrema(values[:0], 2000).tolist() == []


def test_round_off_about_a_constant_is_not_blown_up() -> None:
    columns, rows = run(["rod"], [])
    rows[:, 1] = 19.62 + 1e-13 * np.sin(50 * rows[:, 0])
    (plot,) = compose(columns, rows).axes
    low, high = plot.get_ylim()
    assert high - low > 0.01


@pytest.mark.parametrize("size", [5e-324, 1e-300, 1e-12, 1e15, 1e150])
def test_values_of_any_size_can_be_drawn(size: float) -> None:
    columns, rows = run(["a", "b"], ["p"])
    rows[:, 1:] *= size
    compose(columns, rows)


def test_ticks_that_differ_read_differently() -> None:
    columns, rows = run(["rod"], [])
    rows[:, 0] = 1e6 + np.linspace(0, 1, len(rows))
    drawn = compose(columns, rows)
    backend_agg.FigureCanvasAgg(drawn).draw()
    (plot,) = drawn.axes
    labels = [text.get_text() for text in plot.get_xticklabels()]
    assert len(labels) >= 3
    assert len(set(labels)) == len(labels)
    assert "1000000.2" in labels


def test_the_look_does_not_depend_on_the_settings_of_the_user(tmp_path: Path) -> None:
    draw(tmp_path / "a.png", *CASES["four"], title="T", units=Labels())
    with matplotlib.rc_context(
        {"font.size": 30, "lines.linewidth": 9, "savefig.bbox": "tight", "text.usetex": True}
    ):
        draw(tmp_path / "b.png", *CASES["four"], title="T", units=Labels())
        assert matplotlib.rcParams["font.size"] == 30
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_a_failed_figure_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "run.png"
    path.write_text("old")

    def fail(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(mpl_figure.Figure, "savefig", fail)
    with pytest.raises(OSError, match="No space"):
        draw(path, *CASES["one"], title="", units=Labels())
    assert path.read_text() == "old"
    assert [entry.name for entry in tmp_path.iterdir()] == ["run.png"]


def test_an_unknown_ending_and_a_table_without_time_are_refused(tmp_path: Path) -> None:
    with pytest.raises(formats.UnknownFormat, match=re.escape(".png, .svg, .pdf")):
        draw(tmp_path / "run.gif", *CASES["one"], title="", units=Labels())
    with pytest.raises(ValueError, match='"t"'):
        draw(tmp_path / "run.png", ["lambda.a"], np.zeros((3, 1)), title="", units=Labels())
    assert list(tmp_path.iterdir()) == []


def test_only_the_figure_needs_matplotlib() -> None:
    script = (
        "import sys\nfrom lagcli.output.files import formats\n"
        "from lagcli.output.figures import panels\nfrom lagcli.output.tables import sinks\n"
        "assert 'matplotlib' not in sys.modules and 'pyarrow' not in sys.modules\n"
        "from lagcli.output.figures import chart_figure\nassert 'matplotlib.pyplot' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", script], check=True, cwd=Path(__file__).parents[2])


@pytest.mark.parametrize("letters", [300, 3000, 100_000])
@pytest.mark.parametrize("unbroken", [True, False])
def test_very_long_texts_are_cut_and_break_no_figure(tmp_path: Path, letters: int, unbroken: bool) -> None:
    text = "w" * letters if unbroken else "word " * (letters // 5)
    columns, rows = run([text.replace(" ", "_"), "rod"], ["a"], coordinates=["q" * letters])
    long = Labels(text, text, text)
    drawn = chart_figure.compose_run(columns, rows, title=text, units=long)
    shown = [each.get_text() for each in drawn.findobj(mpl_text.Text)]
    assert max(map(len, shown)) <= 300
    assert sum(map(len, shown)) < 6000
    assert any("…" in each for each in shown)
    drawn.savefig(tmp_path / "long.svg")
    assert min(axes.get_position().width for axes in drawn.axes) > 0.1
    assert min(axes.get_position().height for axes in drawn.axes) > 0
    assert drawn.get_figheight() < 30


def test_a_text_is_cut_in_its_middle() -> None:
    assert labels.shortened("short", 10) == "short"
    assert labels.shortened("a" * 50 + "b" * 50, 20) == "a" * 14 + "…" + "b" * 5
    assert labels.shortened("bell \a", 10) == "bell \N{REPLACEMENT CHARACTER}"
