"""Options that several commands have."""

from __future__ import annotations

import contextlib
import functools
import inspect
import math
import os
import sys
import time
import typing
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

import typer

from lagcli.cli.commands import completing
from lagcli.cli.terminal import console, exits, status_line
from lagcli.errors import diagnostics
from lagcli.model import settings
from lagcli.output.files import atomic_file, formats

if TYPE_CHECKING:
    from lagcli.model.model import Model


def _seconds(context: typer.Context, option: typer.CallbackParam, value: float) -> float:
    """A limit as it is, or that of nobody. Raises `typer.BadParameter` for nan, which no lower bound refuses."""
    if math.isnan(value):
        raise typer.BadParameter("must be a number of seconds, not nan")
    source = context.get_parameter_source(option.name or "")
    return settings.LIMIT if source is None or source.name == "DEFAULT" else value


Completion: TypeAlias = Callable[..., Sequence[str | tuple[str, str]]]
Keywords: TypeAlias = dict[str, Any]  # of a function of the API


def command(*left_out: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Make a command of a function: it has --debug, and always ends in `SystemExit` with its exit code.

    Where the function takes `run_settings` the command has an option for each setting of a run, but for those left out;
    one that is not given is None, and as the model says. A bool that is annotated with a text is a flag of its name
    with this help.
    """

    def with_options(function: Callable[..., None]) -> Callable[..., None]:
        hints = typing.get_type_hints(function, include_extras=True)
        known = settings.table().items()
        rows = {name: row for name, row in known if row[1].is_option and name not in left_out}
        debug = inspect.Parameter("debug", inspect.Parameter.KEYWORD_ONLY, default=False)
        parameters: list[inspect.Parameter] = []
        for parameter in (*inspect.signature(function).parameters.values(), debug):
            name = parameter.name
            if name == "run_settings":
                parameters += [_option(setting, *row) for setting, row in rows.items()]
                continue
            hint = hints.get(name, Annotated[bool, "a traceback where lagcli itself fails"])
            kind, *told = typing.get_args(hint) or (None,)
            if kind is bool and isinstance(told[0], str):
                flag = f"--{name.removeprefix('as_').replace('_', '-')}"
                hint = Annotated[bool, typer.Option(flag, help=told[0])]
            parameters.append(parameter.replace(annotation=hint))

        @functools.wraps(function)
        def called(*, debug: bool, **given: object) -> None:
            if "run_settings" in hints:
                chosen = {name: given.pop(name) for name in rows}
                # A flag that is not set is no `assemble: false`.
                given["run_settings"] = {n: None if value is False else value for n, value in chosen.items()}
            code = exits.BUG
            try:
                with status_line.showing(bool(given.get("quiet"))):
                    code = exits.guarded(lambda: function(**given), debug)
            finally:
                if code != exits.DONE:  # one that ends well has moved or removed its files aside
                    atomic_file.sweep()
            raise SystemExit(code)

        called.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        called.__annotations__ = {each.name: each.annotation for each in parameters}
        return called

    return with_options


def _option(name: str, kind: object, row: settings.RunSetting) -> inspect.Parameter:
    """One setting, with values of this type, as an option."""
    flag = f"--{name.replace('_', '-')}"
    one_of = f": {row.holds.replace('`', '')}" if kind is str else ""
    help_line = row.meaning.replace("`samples`", "--samples") + one_of
    names: Keywords = {}
    if kind is str:
        words = row.holds.split("`")[1::2]

        def begun(incomplete: str) -> list[str]:
            return [word for word in words if word.startswith(incomplete)]

        names = {"metavar": "NAME", "autocompletion": begun}
    option = typer.Option(flag, help=help_line, **names)
    hint = bool if kind is bool else settings.keyword_types()[name]
    default = False if kind is bool else None
    annotation = Annotated[hint, option]  # type: ignore[valid-type]
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)


def named(metavar: str, help_line: str, completion: Completion | None = None) -> object:
    """An option, called as its parameter, with a word for what it takes; completion: of words that are begun."""
    return typer.Option(metavar=metavar, help=help_line, autocompletion=completion)


def argument(metavar: str, help_line: str, completion: Completion | None = None) -> object:
    """An argument, otherwise as `named`."""
    return typer.Argument(metavar=metavar, help=help_line, autocompletion=completion)


def file(help_line: str) -> object:
    """An option, called as its parameter, that takes the name of a file."""
    return named("FILE", help_line)


def output(help_line: str) -> object:
    """The option -o, --output."""
    return typer.Option("-o", "--output", metavar="FILE", help=help_line)


ModelArgument = Annotated[str, argument("MODEL", "model file; - for standard input", completing.model_files)]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=EXPR",
        help="a different value for a parameter (m=2) or a start (theta.value=pi/3, a.z=-1); repeatable",
        autocompletion=completing.settings,
    ),
]
JsonOption = Annotated[bool, "JSON on standard output, errors too"]
LimitOption = Annotated[
    float,
    typer.Option("--limit", metavar="SECONDS", min=0.0, callback=_seconds, help="processor time for proofs"),
]
AssembleOption = Annotated[bool, settings.table()["assemble"][1].meaning]  # of commands that make no run
QuietOption = Annotated[bool, typer.Option("-q", "--quiet", help="only errors on standard error")]
VerboseOption = Annotated[bool, typer.Option("-v", "--verbose", help="more on standard error")]
PointsOption = Annotated[str | None, output(f"the points: {formats.LISTED}; -")]
StartsOption = Annotated[int, typer.Option("--starts", min=0, help="starts beside the declared one")]
SeedOption = Annotated[int, typer.Option("--seed", min=0, help="of these starts; the same for the same seed")]
FromOption = Annotated[
    str | None,
    typer.Option("--from", metavar="FILE[:ROW]", help="start from a row of a table; by default the last"),
]
ForceOption = Annotated[bool, "write over a file that is there"]
NoSchemaOption = Annotated[bool, "no schema for editors beside it, and no line that names it"]
WatchOption = Annotated[bool, "run again at each change of the file, until Ctrl-C"]


def missing(path: str) -> exits.UsageError:
    """The error of a MODEL that does not exist, with the file or the model of the gallery that may be meant."""
    from lagcli.input.starting import first_models

    for ending in (".yaml", ".yml"):
        if os.path.isfile(path + ending):
            return exits.UsageError(f"there is no file {path}; did you mean {path}{ending}?")
    found = first_models.find(os.path.basename(path))
    if found is None:
        return exits.UsageError(f"there is no file {path}")
    copy = f"lagcli models {found.name} -o {found.name}.yaml"
    return exits.UsageError(f"there is no file {path}; the gallery has a model of this name: `{copy}`")


def require_models(paths: Sequence[str]) -> None:
    """Report a MODEL that does not exist before the others are worked on. Raises `exits.UsageError`."""
    for path in paths:
        if path != "-" and not os.path.exists(path):
            raise missing(path)
    if paths.count("-") > 1:
        raise exits.UsageError("standard input can be read once only")


def load(path: str, changes: list[str] | None) -> Model:
    """The model with the values of `--set`. Raises `exits.UsageError`, `diagnostics.ModelError`."""
    # The reader of models is no part of what --help needs.
    from lagcli.api import load as reading

    given: dict[str, object] = {}
    for change in changes or ():
        name, sign, value = change.partition("=")
        if not sign or not name.strip():
            raise exits.UsageError(f"--set {change}: write NAME=EXPR")
        given[name.strip()] = value
    try:
        return reading.load(path, given)
    except FileNotFoundError:
        raise missing(path) from None
    except OSError as error:
        raise exits.UsageError(f"cannot read {path}: {error.strerror}") from None


def read(path: str, changes: list[str] | None, as_json: bool, verbose: bool = False) -> Model:
    """The model as `load` gives it; its errors are JSON where that is asked for, its warnings printed if `verbose`."""
    with json_errors(as_json):
        model = load(path, changes)
    if verbose:
        exits.print_warnings(model.warnings)
    return model


@contextlib.contextmanager
def json_errors(as_json: bool) -> Iterator[None]:
    """Inside the block an invalid model is reported on stdout where JSON was asked for."""
    try:
        yield
    except diagnostics.ModelError as error:
        if as_json:
            print(formats.json_line(errors(error)))
            raise exits.Exit(exits.of(error)) from None
        raise


@contextlib.contextmanager
def refusals(as_json: bool = False, worded: Callable[[str], str] = str) -> Iterator[None]:
    """Around a function of the Python interface: what it refuses is wrong on the command line, with exit 2.

    worded: makes the message for the command line of its own; as_json: as of `json_errors`.
    """
    with json_errors(as_json):
        try:
            yield
        except ValueError as error:
            raise exits.UsageError(worded(str(error))) from None


@contextlib.contextmanager
def stops(rows_are_for: str = "") -> Iterator[None]:
    """Around what needs rows: a run that stopped without them ends the command with exit 3, and says for what."""
    from lagcli.running.trajectory import SimulationStopped

    try:
        yield
    except SimulationStopped as stopped:
        end = f"; there is no row to {rows_are_for}" if rows_are_for else ""
        exits.print_err(f"lagcli: {stopped.reason}{end}")
        raise exits.Exit(exits.STOPPED) from None


@contextlib.contextmanager
def reading(name: str, option: str = "") -> Iterator[None]:
    """Around what reads the table `name`: one that cannot be read, or is none, is refused; option: what named it."""
    from lagcli.output.tables import table_format

    label = f"{option}: " if option else ""
    try:
        yield
    except OSError as error:
        raise exits.UsageError(f"{label}cannot read {name}: {error.strerror or error}") from None
    except table_format.UNREADABLE as error:
        raise exits.UsageError(f"{label}{error}") from None


def errors(error: diagnostics.ModelError) -> dict[str, object]:
    """The JSON of an invalid model."""
    return {"errors": [diagnostic.as_json() for diagnostic in error.diagnostics]}


def follow(
    paths: Sequence[str],
    run: Callable[[], None],
    quiet: bool = False,
    pause: Callable[[], None] | None = None,
) -> None:
    """Run a command, and again whenever one of the files is another one; it ends by an interrupt, or by `pause`.

    The files are looked at several times a second: that works on every platform and file system, and where an editor
    puts a new file into the place of the old one. What a run raises as commands may is printed. pause: waits for a
    moment; whatever it raises ends the watch. Raises `exits.UsageError` for standard input.
    """
    if "-" in paths:
        raise exits.UsageError("--watch needs a file: standard input is read once")
    pause = pause or functools.partial(time.sleep, status_line.TICK)

    def stamps() -> list[tuple[int, int, int] | None]:
        """Time of change, size and number of each file, by which it is known again; None where it is not there."""
        marks: list[tuple[int, int, int] | None] = [None] * len(paths)
        for i, path in enumerate(paths):
            with contextlib.suppress(OSError):
                found = os.stat(path)
                marks[i] = (found.st_mtime_ns, found.st_size, found.st_ino)
        return marks

    while True:
        # Taken before the run: a change while it goes on is one to run again for.
        seen = stamps()
        console.clear()
        with status_line.showing(quiet):
            exits.outcome(run)
        if not quiet:
            names = os.path.basename(paths[0]) if len(paths) == 1 else f"{len(paths)} files"
            exits.print_err(f"watching {names}; Ctrl-C ends")
        sys.stdout.flush()
        while (now := stamps()) == seen:
            pause()
        # An editor may write in several steps, or take the old file away first: wait until nothing changes.
        settled = None
        while settled != now:
            pause()
            settled, now = now, stamps()
