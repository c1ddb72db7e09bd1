"""`lagcli animate`: the page or the film of a run."""

from __future__ import annotations

import contextlib
import os
import pathlib
import sys
from collections.abc import Callable, Iterator
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
from lagcli.output.files import atomic_file, formats, write_guard

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
    is_table, file = formats.is_table(source), None if output == "-" else output
    _require(source, file, model, changes, {**run_settings, "from": begin})
    write = _writer(file)
    if is_table:
        scene, reason = _of_table(source, model, changes), ""
    else:
        scene, reason = _of_model(source, changes, verbose, run_settings, begin)
    target = pathlib.Path(file) if file is not None else None
    if reason and target is not None:
        target = atomic_file.partial_of(target)
    write(target, scene)
    exits.print_notes(scene.notes, quiet)
    if target is not None and not quiet:
        size = os.path.getsize(target)
        exits.print_err(f"done: {target}, {size / 1e6:.2f} MB, {len(scene.t)} instants")
    if reason:
        if target is not None:
            exits.print_err(f"lagcli: what there is of the run is in {target}")
        exits.print_err(f"lagcli: {reason}")
        raise exits.Exit(exits.STOPPED)


def _require(
    source: str, file: str | None, model: str | None, changes: list[str] | None, given: dict[str, object]
) -> None:
    """Refuse what cannot be done with this MODEL or FILE. Raises `exits.UsageError`, `write_guard.WriteError`."""
    if not formats.is_table(source):
        if model is not None:
            raise exits.UsageError(f"--model is of a table, and {source} is a model")
    elif of_runs := [name.replace("_", "-") for name, value in given.items() if value is not None]:
        raise exits.UsageError(f"--{of_runs[0]} is of a run, and {source} is the table of one")
    elif changes and model is None:
        raise exits.UsageError("--set is of a model; give that of the table with --model")
    model_reading.require_models([source, *([model] if model else [])])
    if file is None and sys.stdout.isatty():
        raise exits.UsageError("a page is not for a terminal: give -o FILE.html, or send it on")
    if file is not None:
        read = [("MODEL", source), ("MODEL", model or None)]
        write_guard.require(read, ("--output", file, formats.ANIMATIONS))


def _writer(file: str | None) -> Callable[[pathlib.Path | None, Scene], None]:
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


@contextlib.contextmanager
def _showing() -> Iterator[None]:
    """Around what makes a scene: where there is nothing to show that is refused."""
    from lagcli.output.animation.builder import NothingToShow

    try:
        yield
    except NothingToShow as error:
        raise exits.UsageError(str(error)) from None


def _of_table(source: str, model: str | None, changes: list[str] | None) -> Scene:
    from lagcli.api import animate as animating

    read = model_reading.load(model, changes) if model is not None else None
    with _showing(), model_reading.reading(source):
        return animating.of_file(source, read)


def _of_model(
    source: str, changes: list[str] | None, verbose: bool, given: RunSettings, row: str | None
) -> tuple[Scene, str]:
    """The scene of a run, and why it stopped before its end, or nothing."""
    from lagcli.api import animate as animating

    model = model_reading.read(source, changes, False, verbose)
    with _showing(), model_reading.stops("show"):
        return animating.as_far(model, given, row)
