"""MODEL of a command line, read with its changes, and what is refused about it and what is asked of it."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

from lagcli.cli.terminal import exits
from lagcli.errors import diagnostics
from lagcli.output.files import formats

if TYPE_CHECKING:
    from lagcli.model.model import Model


def missing(path: str) -> exits.UsageError:
    """The error of a MODEL that does not exist, with the file or the model of the gallery that may be meant."""
    from lagcli.input.starting import gallery_models

    for ending in (".yaml", ".yml"):
        if os.path.isfile(path + ending):
            return exits.UsageError(f"there is no file {path}; did you mean {path}{ending}?")
    found = gallery_models.find(os.path.basename(path))
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
    from lagcli.api.models import load as reading

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
