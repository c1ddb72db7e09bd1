"""MODEL of a command line, read with its changes, and its errors where they are asked for."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

from lagcli.cli.terminal import exits
from lagcli.errors import diagnostics
from lagcli.output.files import json_text

if TYPE_CHECKING:
    from lagcli.model.model import Model

T = TypeVar("T")


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


def require_models(paths: list[str]) -> None:
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
    """The model as `load` gives it; its errors are reported as by `reported`, its warnings where `verbose`."""
    found = reported(lambda: load(path, changes), as_json)
    if verbose:
        exits.print_err_all(warning.render() for warning in found.warnings)
    return found


def reported(compute: Callable[[], T], as_json: bool) -> T:
    """The value of `compute`; an invalid model is reported on stdout where JSON was asked for."""
    try:
        return compute()
    except diagnostics.ModelError as error:
        if as_json:
            print(json_text.text(errors(error)))
            raise exits.Exit(exits.of(error)) from None
        raise


def errors(error: diagnostics.ModelError) -> dict[str, object]:
    """The JSON of an invalid model."""
    return {"errors": [found.as_json() for found in error.diagnostics]}
