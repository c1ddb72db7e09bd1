"""`lagcli models`: the list of the gallery, and a copy of one of its models."""

from __future__ import annotations

import os
import textwrap
from typing import Annotated

import typer

from lagcli.cli.commands import completing, new_files, options
from lagcli.cli.terminal import console, exits
from lagcli.errors import diagnostics
from lagcli.input.starting import gallery_models
from lagcli.input.starting.gallery_models import GalleryModel
from lagcli.output.files import formats

INDENT = 2  # spaces


@exits.command
def models(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="[NAME]", help="a model of the gallery", autocompletion=completing.gallery_names
        ),
    ] = None,
    output: Annotated[
        str | None,
        typer.Option("-o", "--output", metavar="FILE", help="copy it to this file, or into this folder"),
    ] = None,
    force: options.ForceOption = False,
    no_schema: options.NoSchemaOption = False,
    as_json: Annotated[bool, typer.Option("--json", help="JSON on standard output")] = False,
    quiet: options.QuietOption = False,
    debug: options.DebugOption = False,
) -> None:
    """List the models of the gallery by subject, print one, or copy it with -o."""
    if name is None and output is not None:
        raise exits.UsageError("-o copies one model: give its NAME; `lagcli models` lists them")
    if name is None:
        listed(as_json, quiet)
        return
    chosen = found(name)
    if output is None:
        printed(chosen, as_json)
    else:
        copied(chosen, output, not no_schema, force, quiet)


def listed(as_json: bool, quiet: bool) -> None:
    """Print all models by subject. Raises `exits.UsageError` where there is no gallery."""
    models = _models()
    if as_json:
        print(formats.json_line({"models": [_described(model) for model in models]}))
        return
    width = max(len(model.name) for model in models) + 2 * INDENT
    subject = ""
    for model in models:
        if model.subject != subject:
            print(*([""] if subject else []), model.subject, sep="\n" if subject else "")
            subject = model.subject
        line = f"{'':{INDENT}}{model.name:{width - INDENT}}{model.teaches}"
        print(textwrap.fill(line, console.width(), subsequent_indent=" " * width, break_long_words=False))
    if not quiet:
        exits.print_err("`lagcli models NAME` prints a model, `lagcli models NAME -o FILE` copies it")


def found(name: str) -> GalleryModel:
    """The model of this name. Raises `exits.UsageError` with the nearest name."""
    models = _models()
    one = gallery_models.find(name)
    if one is None:
        hint = diagnostics.nearest(name, [model.name for model in models]) or "`lagcli models` lists them"
        raise exits.UsageError(f"there is no model `{name}` in the gallery; {hint}")
    return one


def printed(model: GalleryModel, as_json: bool) -> None:
    """Print the text of a model."""
    if as_json:
        print(formats.json_line({**_described(model), "text": model.text()}))
    else:
        print(model.text(), end="")


def copied(model: GalleryModel, output: str, with_schema: bool, force: bool, quiet: bool) -> None:
    """Copy a model, with its line for editors and the schema beside it."""
    from lagcli.input import format_schema  # here, as help and lists need none of it

    if output == new_files.STDOUT:
        printed(model, as_json=False)
        return
    if os.path.isdir(output):
        output = os.path.join(output, f"{model.name}.yaml")
    head = f"{format_schema.EDITOR_LINE}\n" if with_schema else ""
    is_new = new_files.write(output, head + model.text(), force=force)
    messages = [f"wrote {output}" if is_new else f"{output} is this model already"]
    if with_schema:
        messages.append(new_files.schema_beside(output))
    exits.print_err_all(() if quiet else filter(None, messages))


def _models() -> tuple[GalleryModel, ...]:
    models = gallery_models.models()
    if not models:
        raise exits.UsageError(
            "this installation holds no gallery: install the wheel, or run from a checkout"
        )
    return models


def _described(model: GalleryModel) -> dict[str, object]:
    return {
        "name": model.name,
        "subject": model.subject,
        "title": model.title(),
        "teaches": model.teaches,
        "path": str(model.path),
    }
