"""`lagcli animate`: the page or the film of a run."""

from __future__ import annotations

import dataclasses
import os
import pathlib
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated

import typer

from lagcli.cli.commands import completing, model_reading
from lagcli.cli.commands.options import (
    DebugOption,
    FromOption,
    QuietOption,
    SetOption,
    VerboseOption,
    with_run_settings,
)
from lagcli.cli.terminal import exits
from lagcli.model.settings import RunSettings
from lagcli.output.files import atomic_file, file_requests, formats, write_guard

if TYPE_CHECKING:
    from lagcli.output.animation.scene import Scene


@exits.command
@with_run_settings()
def animate(
    source: Annotated[
        str,
        typer.Argument(
            metavar="MODEL|FILE",
            help="a model, which is simulated, or a table of a run",
            autocompletion=completing.run_files,
        ),
    ],
    output: Annotated[
        str | None,
        typer.Option("-o", "--output", metavar="FILE", help="page: .html; film: .gif, .mp4; - for stdout"),
    ] = None,
    model: Annotated[
        str | None,
        typer.Option(
            "--model",
            metavar="MODEL",
            help="of a table: for masses, forces, rods and surfaces",
            autocompletion=completing.model_files,
        ),
    ] = None,
    *,
    run_settings: RunSettings,
    begin: FromOption = None,
    changes: SetOption = None,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
    debug: DebugOption = False,
) -> None:
    """Write the motion as one page that needs nothing else: particles, rods, surfaces, R and F, lambda beside it.

    The page on standard output without -o. A model is simulated with its own settings. Exit 3 where the run stops
    before its end: the page of what there is stands in FILE.partial, and FILE is as it was.
    """
    options = AnimateOptions(source, output, model, tuple(changes or ()), quiet, verbose)
    options.require({**run_settings, "from": begin})
    carry_out(options, run_settings, begin)


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
        return formats.is_table(self.source)

    @property
    def file(self) -> str | None:
        """The file that is written; None for standard output."""
        return None if self.output in (None, "-") else self.output

    def require(self, given: dict[str, object]) -> None:
        """Refuse what cannot be done. Raises `exits.UsageError`, `write_guard.WriteError`."""
        if not self.is_table and self.model is not None:
            raise exits.UsageError(f"--model is of a table, and {self.source} is a model")
        if self.is_table:
            own = [f"--{name.replace('_', '-')}" for name, value in given.items() if value is not None]
            if own:
                raise exits.UsageError(f"{own[0]} is of a run, and {self.source} is the table of one")
            if self.changes and self.model is None:
                raise exits.UsageError("--set is of a model; give that of the table with --model")
        model_reading.require_models([self.source, *([self.model] if self.model else [])])
        if self.file is None and sys.stdout.isatty():
            raise exits.UsageError("a page is not for a terminal: give -o FILE.html, or send it on")
        if self.file is not None:
            read = [("MODEL", self.source), ("MODEL", self.model or None)]
            file_requests.require(read, ("--output", self.file, formats.ANIMATIONS))


def carry_out(options: AnimateOptions, given: RunSettings, row: str | None) -> None:
    """Make the scene and write it. Raises `exits.Exit` with 3 where the run stopped before its end."""
    from lagcli.output.animation.point_tracks import NothingToShow
    from lagcli.running.trajectory import SimulationStopped

    write = writer(options.file)
    try:
        scene, reason = _of_table(options) if options.is_table else _of_model(options, given, row)
    except NothingToShow as error:
        raise exits.UsageError(str(error)) from None
    except SimulationStopped as stopped:
        exits.print_err(f"lagcli: {stopped.reason}; there is no row to show")
        raise exits.Exit(exits.STOPPED) from None
    target = pathlib.Path(options.file) if options.file is not None else None
    if reason and target is not None:
        target = atomic_file.partial_of(target)
    write(target, scene)
    if not options.quiet:
        print_report(target, scene)
    if reason:
        if target is not None:
            exits.print_err(f"lagcli: what there is of the run is in {target}")
        exits.print_err(f"lagcli: {reason}")
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
    from lagcli.output.animation import page

    if path is None:
        sys.stdout.write(page.text(scene))
        return
    with write_guard.writing(str(path)):
        page.write(path, scene)


def _of_table(options: AnimateOptions) -> tuple[Scene, str]:
    from lagcli.api import animate as animating
    from lagcli.output.tables import read_table

    model = model_reading.load(options.model, list(options.changes)) if options.model is not None else None
    try:
        return animating.of_file(options.source, model), ""
    except read_table.UNREADABLE as error:
        raise exits.UsageError(str(error)) from None
    except OSError as error:
        raise exits.UsageError(f"cannot read {options.source}: {error.strerror or error}") from None


def _of_model(options: AnimateOptions, given: RunSettings, row: str | None) -> tuple[Scene, str]:
    from lagcli.api import animate as animating

    model = model_reading.load(options.source, list(options.changes))
    if options.verbose:
        exits.print_err_all(warning.render() for warning in model.warnings)
    return animating.as_far(model, given, row)
