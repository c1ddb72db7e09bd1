"""`lagcli animate`: the page or the film of a run."""

from __future__ import annotations

import dataclasses
import os
import pathlib
import sys
from collections.abc import Callable
from typing import TypedDict

from lagcli.api import animate
from lagcli.api.runs import run_settings, start_row
from lagcli.cli.requests import model_reading
from lagcli.cli.terminal import exits
from lagcli.output.animation import page
from lagcli.output.animation.point_tracks import NothingToShow
from lagcli.output.animation.scene import Scene
from lagcli.output.files import atomic_file, file_requests, formats, write_guard
from lagcli.output.tables.table_format import MissingExtra, UnreadableTable
from lagcli.output.trajectory import SimulationStopped


class AnimatedRun(TypedDict):
    """The settings of the run, None where the file's stays."""

    duration: float | None
    output_step: float | None
    samples: int | None
    rtol: float | None
    atol: float | None
    max_step: float | None
    method: str | None
    assemble: bool | None
    begin: str | None


@dataclasses.dataclass(frozen=True, slots=True)
class AnimateOptions:
    """Options of `animate` besides the settings of the run; source: MODEL or FILE."""

    source: str
    output: str | None
    model: str | None
    changes: tuple[str, ...]
    quiet: bool
    verbose: bool

    @property
    def is_table(self) -> bool:
        """True if the source is a table by its ending."""
        return pathlib.Path(self.source).suffix.lower().removeprefix(".") in formats.TABLES

    @property
    def file(self) -> str | None:
        """The file that is written; None for standard output."""
        return None if self.output in (None, "-") else self.output

    def require(self, given: AnimatedRun) -> None:
        """Refuse what cannot be done. Raises `exits.UsageError`, `write_guard.WriteError`."""
        if not self.is_table and self.model is not None:
            raise exits.UsageError(f"--model is of a table, and {self.source} is a model")
        if self.is_table:
            own = [f"--{name.replace('_', '-')}" for name, value in given.items() if value is not None]
            if own:
                option = own[0].replace("--begin", "--from")
                raise exits.UsageError(f"{option} is of a run, and {self.source} is the table of one")
            if self.changes and self.model is None:
                raise exits.UsageError("--set is of a model; give that of the table with --model")
        model_reading.require_models([self.source, *([self.model] if self.model else [])])
        file_requests.require_endings((self.file, formats.ANIMATIONS))
        if self.file is None and sys.stdout.isatty():
            raise exits.UsageError("a page is not for a terminal: give -o FILE.html, or send it on")
        if self.file is not None:
            known = [
                *file_requests.model_file(self.source),
                *(file_requests.model_file(self.model) if self.model else ()),
            ]
            file_requests.require_writable(
                known, [file_requests.File("--output", self.file, is_written=True)]
            )


def run(options: AnimateOptions, given: AnimatedRun) -> None:
    """Make the scene and write it. Raises `exits.Exit` with 3 where the run stopped before its end."""
    write = writer(options.file)
    stopped: SimulationStopped | None = None
    try:
        if options.is_table:
            scene = _of_table(options)
        else:
            scene, stopped = _of_model(options, given)
    except NothingToShow as error:
        raise exits.UsageError(str(error)) from None
    target = pathlib.Path(options.file) if options.file is not None else None
    if stopped is not None and target is not None:
        target = atomic_file.partial_of(target)
    write(target, scene)
    if not options.quiet:
        print_report(target, scene)
    if stopped is not None:
        if target is not None:
            exits.print_err(f"lagcli: what there is of the run is in {target}")
        exits.print_err(f"lagcli: {stopped}")
        raise exits.Exit(exits.STOPPED)


def print_report(target: pathlib.Path | None, scene: Scene) -> None:
    """The account of what was written."""
    exits.print_err_all(f"note: {note}" for note in scene.notes)
    if target is not None:
        size = os.path.getsize(target)
        exits.print_err(f"done: {target}, {size / 1e6:.2f} MB, {len(scene.t)} instants")


def writer(file: str | None) -> Callable[[pathlib.Path | None, Scene], None]:
    """The function that writes a scene, by the ending; it is known before any work whether a film can be written.
    Raises `exits.UsageError`."""
    fmt = formats.of(pathlib.Path(file), formats.ANIMATIONS) if file is not None else "html"
    if fmt == "html":
        return _write_page
    # matplotlib takes a third of a second to load: only where a film is asked for.
    from lagcli.output.animation import film

    try:
        film.require(fmt)
    except film.NoFilmWriter as error:
        raise exits.UsageError(f"--output {file}: {error}") from None

    def write_film(path: pathlib.Path | None, scene: Scene) -> None:
        assert path is not None
        with write_guard.drawing(str(path)):
            film.write(path, scene, fmt)

    return write_film


def _write_page(path: pathlib.Path | None, scene: Scene) -> None:
    if path is None:
        sys.stdout.write(page.text(scene))
        return
    with write_guard.writing(str(path)):
        page.write(path, scene)


def _of_table(options: AnimateOptions) -> Scene:
    model = model_reading.load(options.model, list(options.changes)) if options.model is not None else None
    try:
        return animate.of_file(options.source, model)
    except (MissingExtra, UnreadableTable, formats.UnknownFormat) as error:
        raise exits.UsageError(str(error)) from None
    except OSError as error:
        raise exits.UsageError(f"cannot read {options.source}: {error.strerror or error}") from None


def _of_model(options: AnimateOptions, given: AnimatedRun) -> tuple[Scene, SimulationStopped | None]:
    model = model_reading.load(options.source, list(options.changes))
    if options.verbose:
        exits.print_err_all(warning.render() for warning in model.warnings)
    if given["begin"] is not None:
        model = start_row.of_option(model, given["begin"])
    settings = {key: value for key, value in given.items() if key != "begin"}
    try:
        run_settings.chosen(model, settings)
    except ValueError as error:
        raise exits.UsageError(str(error)) from None
    try:
        return animate.of_model(model, settings), None
    except SimulationStopped as stop:
        return animate.of_run(model, dict(stop.trajectory)), stop
