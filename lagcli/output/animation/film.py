"""A scene as a film, GIF or MP4, drawn and written by matplotlib."""

from __future__ import annotations

import contextlib
import itertools
import pathlib
import tempfile

import matplotlib
import numpy as np
from matplotlib import animation, collections, colors, figure, lines
from matplotlib.backends import backend_agg

from lagcli import progress
from lagcli.arrays import Floats, Integers
from lagcli.output.animation import nets, page
from lagcli.output.animation.scene import Scene, at_instant, largest
from lagcli.output.figures import figure_page, labels
from lagcli.output.files import atomic_file

RATES = {"gif": 25, "mp4": 30}  # pictures a second at most
WIDTH, HEIGHT, DPI = 8.0, 4.5, 120  # inches; 960 by 540 pixels, an even number of each for MP4
MOST_PICTURES = 1500  # a minute at 25 a second
INK, GREY, REACTION, FORCE = "#1a1d21", "#6c7885", "#b3470a", "#007a5a"
MOST_CURVES = 8  # as many as colors are told apart
# Of trails, as on a page: particles that have one, how far back it goes as a part of the run, its pieces that fade.
MOST_TRAILS, LENGTH, FADES = 24, 0.2, 12


class NoFilmWriter(ValueError):
    """The program that writes this kind of film is not there."""


def require(fmt: str) -> None:
    """Raise `NoFilmWriter` where a film of this ending cannot be written."""
    if fmt == "mp4" and not animation.FFMpegWriter.isAvailable():
        raise NoFilmWriter("mp4 needs the program ffmpeg, which is not found; write .gif or .html")


def _look() -> contextlib.AbstractContextManager[None]:
    """The look of films; texts of a model are no formulas."""
    return matplotlib.rc_context({"text.parse_math": False, "font.size": 8})


@progress.phase("drawing the film")
def write(path: pathlib.Path, scene: Scene, fmt: str) -> int:
    """Write the film aside and move it into place; return how many pictures it has. Raises `NoFilmWriter`, OSError."""
    require(fmt)
    shown, rate = pictures(scene, fmt)
    writer: animation.AbstractMovieWriter
    if fmt == "gif":
        writer = animation.PillowWriter(fps=rate)  # type: ignore[arg-type] # a part of a second is fine
    else:
        writer = animation.FFMpegWriter(fps=rate, codec="h264", extra_args=["-pix_fmt", "yuv420p"])  # type: ignore[arg-type]
    with tempfile.TemporaryDirectory() as folder:
        made = pathlib.Path(folder) / f"film.{fmt}"  # the writers know the format by the ending
        with _look(), figure_page.any_sign():
            drawing = _Drawing(scene)
            # Not `saving` of matplotlib, which finishes a film that an interrupt has broken off too, and fails where it
            # has no picture yet.
            writer.setup(drawing.figure, str(made), DPI)
            with (
                matplotlib.rc_context({"savefig.bbox": None}),
                atomic_file.undone_by(lambda: _abandon(writer)),
            ):
                for frame in shown:
                    drawing.show(int(frame))
                    writer.grab_frame()
                writer.finish()
        atomic_file.write(path, made.read_bytes())
    return len(shown)


def picture(scene: Scene, fmt: str) -> bytes:
    """The first instant as a file of a format of figures."""
    with _look():
        drawing = _Drawing(scene)
        drawing.show(0)
        return figure_page.content(fmt, drawing.figure)


def pictures(scene: Scene, fmt: str) -> tuple[Integers, float]:
    """The instants that are shown one after another, each a row of the run, and how many of them a second."""
    if len(scene.t) < 2:
        return np.zeros(1, dtype=np.int64), 1.0
    seconds = float(scene.t[-1] - scene.t[0]) / scene.rate
    count = int(min(MOST_PICTURES, len(scene.t), max(2, round(seconds * RATES[fmt]) + 1)))
    times = np.linspace(scene.t[0], scene.t[-1], count)
    after = np.clip(np.searchsorted(scene.t, times), 1, len(scene.t) - 1)
    nearer = np.abs(scene.t[after] - times) < np.abs(scene.t[after - 1] - times)
    shown = np.where(nearer, after, after - 1).astype(np.int64)
    return shown, (count - 1) / seconds if seconds > 0 else 1.0


def _abandon(writer: animation.AbstractMovieWriter) -> None:
    """End the program that writes a film, where there is one."""
    process = getattr(writer, "_proc", None)
    if process is not None:
        process.kill()
        process.communicate()


class _Drawing:
    """The figure of a film, whose parts are moved from picture to picture."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self.figure = figure.Figure(figsize=(WIDTH, HEIGHT), dpi=DPI)
        backend_agg.FigureCanvasAgg(self.figure)
        self.figure.suptitle(labels.shortened(scene.title, labels.NAME), fontsize=10, x=0.02, ha="left")
        share = 0.66 if scene.curves else 1.0
        self._plot = self.figure.add_axes((0.0, 0.0, share, 0.92))
        width, height = share * WIDTH * DPI, 0.92 * HEIGHT * DPI
        self._plot.set_axis_off()
        self._plot.set_xlim(0, width)
        self._plot.set_ylim(height, 0)
        self._to = page.Projection(scene, width, height)
        widths = [0.3 if one.kind == "net" else 0.8 for one in scene.surfaces]
        self._rims = [self._plot.plot([], [], color=GREY, linewidth=width)[0] for width in widths]
        # The trails of moving particles, where they are few
        self._trails: list[tuple[Floats, collections.LineCollection]] = []
        for k in range(scene.count if scene.count <= MOST_TRAILS and not scene.modes else 0):
            if len(scene.points[k]) > 1:
                fading = np.linspace(0.05, 0.7, FADES)
                colours = [(*colors.to_rgb(page.colour(k, scene.count)), alpha) for alpha in fading]
                trail = collections.LineCollection([], colors=colours, linewidths=1.4)
                self._plot.add_collection(trail)
                self._trails.append((self._to(scene.points[k]), trail))
        self._links = collections.LineCollection([], colors=GREY, linewidths=1.6)
        self._plot.add_collection(self._links)
        looks = [page.colour(k, scene.count) for k in range(scene.count)]
        sizes = (2 * np.maximum(2.0, scene.radii * self._to.scale) * 72 / DPI) ** 2
        nothing = np.zeros((4, scene.count))
        self._balls = self._plot.scatter(nothing[0], nothing[1], s=sizes, c=looks, zorder=3)
        self._arrows = []
        for forces, look in ((scene.R, REACTION), (scene.F, FORCE)):
            if forces and scene.scale:
                drawn = self._plot.quiver(
                    *nothing, color=look, angles="xy", scale_units="xy", scale=1.0, width=0.005, zorder=4
                )
                self._arrows.append((forces, drawn))
        self._clock = self._plot.text(8, height - 8, "", color=INK)
        self._cursor: lines.Line2D | None = None
        if scene.curves:
            # The multipliers, and the line that runs over them
            plot = self.figure.add_axes((0.72, 0.12, 0.26, 0.76))
            for k, (name, values) in enumerate(largest(scene.curves, MOST_CURVES).items()):
                label = labels.shortened(name, 24)
                plot.plot(scene.t, values, linewidth=1.0, color=page.PALETTE[k], label=label)
            plot.set_title("λ over t", fontsize=8, loc="left")
            plot.legend(fontsize=6, frameon=False, loc="best")
            plot.spines[["top", "right"]].set_visible(False)
            self._cursor = plot.axvline(float(scene.t[0]), color=INK, linewidth=0.8)

    def show(self, frame: int) -> None:
        """Move everything to an instant."""
        scene = self._scene
        for rim, one in zip(self._rims, scene.surfaces, strict=True):
            corners = nets.strings(one.corners_at(frame)) if one.kind == "net" else page.outline(one, frame)
            rim.set_data(*self._to(corners).T)
        first = int(np.searchsorted(scene.t, scene.t[frame] - LENGTH * (scene.t[-1] - scene.t[0])))
        cuts = np.linspace(first, frame, FADES + 1).round().astype(np.int64)
        for path, drawn in self._trails:
            drawn.set_segments([path[begin : end + 1] for begin, end in itertools.pairwise(cuts)])
        ends = [np.stack([scene.at(end, frame) for end in link.ends]) for link in scene.links]
        self._links.set_segments([self._to(pair) for pair in ends])
        here = np.array([scene.at(k, frame) for k in range(scene.count)]).reshape(-1, 3)
        flat = self._to(here)
        self._balls.set_offsets(flat)
        for forces, arrows in self._arrows:
            force = np.array([at_instant(track, frame) for track in forces])
            tips = self._to(here + scene.scale * force) - flat
            arrows.set_offsets(flat)
            arrows.set_UVC(tips[:, 0], tips[:, 1])
        self._clock.set_text(f"t = {scene.t[frame]:.4g} {labels.shortened(scene.units[0], labels.UNIT)}")
        if self._cursor is not None:
            self._cursor.set_xdata([scene.t[frame], scene.t[frame]])
