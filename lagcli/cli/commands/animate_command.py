"""`lagcli animate`: the page or the film of a run."""

from __future__ import annotations

import os
import pathlib
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated

from lagcli.cli.commands import completing, options
from lagcli.cli.terminal import exits
from lagcli.model.settings import RunSettings
from lagcli.output.files import atomic_file, formats, write_guard

if TYPE_CHECKING:
    from lagcli.output.animation.scene import Scene


@options.command()
def animate(
    source: Annotated[
        str,
        options.argument(
            "MODEL|FILE", "a model, which is simulated, or a table of a run", completing.run_files
        ),
    ],
    output: Annotated[str | None, options.output("page: .html; film: .gif, .mp4; - for stdout")] = None,
    model: Annotated[
        str | None,
        options.named("MODEL", "of a table: for masses, forces, rods and surfaces", completing.model_files),
    ] = None,
    *,
    run_settings: RunSettings,
    begin: options.FromOption = None,
    changes: options.SetOption = None,
    quiet: options.QuietOption = False,
    verbose: options.VerboseOption = False,
) -> None:
    """Write the motion as one page that needs nothing else: particles, rods, surfaces, R and F, lambda beside it.

    The page on standard output without -o. A model is simulated with its own settings. Exit 3 where the run stops
    before its end: the page of what there is stands in FILE.partial, and FILE is as it was.
    """
    is_table, file = formats.is_table(source), None if output == "-" else output
    if not is_table and model is not None:
        raise exits.UsageError(f"--model is of a table, and {source} is a model")
    if is_table:
        given = {**run_settings, "from": begin}
        of_runs = [name.replace("_", "-") for name, value in given.items() if value is not None]
        if of_runs:
            raise exits.UsageError(f"--{of_runs[0]} is of a run, and {source} is the table of one")
        if changes and model is None:
            raise exits.UsageError("--set is of a model; give that of the table with --model")
    options.require_models([source, *([model] if model else [])])
    if file is None and sys.stdout.isatty():
        raise exits.UsageError("a page is not for a terminal: give -o FILE.html, or send it on")
    if file is not None:
        read = [("MODEL", source), ("MODEL", model or None)]
        write_guard.require(read, ("--output", file, formats.ANIMATIONS))
    write = _writer(file)
    from lagcli.api import animate as animating
    from lagcli.output.animation.builder import NothingToShow

    reason = ""
    try:
        if is_table:
            of_table = options.load(model, changes) if model is not None else None
            with options.reading(source):
                scene = animating.of_file(source, of_table)
        else:
            with options.stops("show"):
                simulated = options.read(source, changes, False, verbose)
                scene, reason = animating.as_far(simulated, run_settings, begin)
    except NothingToShow as error:
        raise exits.UsageError(str(error)) from None
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


def _writer(file: str | None) -> Callable[[pathlib.Path | None, Scene], None]:
    """The function that writes a scene, by the ending. Raises `exits.UsageError` for a film that nothing writes."""
    fmt = formats.of(pathlib.Path(file), formats.ANIMATIONS) if file is not None else "html"
    if fmt != "html":
        # matplotlib takes a third of a second to load: only where a film is asked for.
        from lagcli.output.animation import film

        try:
            film.require(fmt)
        except film.NoFilmWriter as error:
            raise exits.UsageError(f"--output {file}: {error}") from None

    def write(path: pathlib.Path | None, scene: Scene) -> None:
        from lagcli.output.animation import page

        if path is None:
            sys.stdout.write(page.text(scene))
        elif fmt == "html":
            with write_guard.writing(str(path)):
                page.write(path, scene)
        else:
            with write_guard.drawing(str(path)):
                film.write(path, scene, fmt)

    return write
