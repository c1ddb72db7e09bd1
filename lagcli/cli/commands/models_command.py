"""`lagcli models`: the list of the gallery, and a copy of one of its models."""

from __future__ import annotations

import os
import textwrap
from typing import Annotated

from lagcli.cli.commands import completing, new_command, options
from lagcli.cli.terminal import console, exits
from lagcli.errors import diagnostics
from lagcli.input.starting import first_models
from lagcli.input.starting.first_models import GalleryModel
from lagcli.output.files import formats

INDENT = 2  # spaces


@options.command()
def models(
    name: Annotated[
        str | None, options.argument("[NAME]", "a model of the gallery", completing.gallery_names)
    ] = None,
    output: Annotated[str | None, options.output("copy it to this file, or into this folder")] = None,
    force: options.ForceOption = False,
    no_schema: options.NoSchemaOption = False,
    as_json: Annotated[bool, "JSON on standard output"] = False,
    quiet: options.QuietOption = False,
) -> None:
    """List the models of the gallery by subject, print one, or copy it with -o."""
    if name is None and output is not None:
        raise exits.UsageError("-o copies one model: give its NAME; `lagcli models` lists them")
    gallery = first_models.models()
    if not gallery:
        hint = "install the wheel, or run from a checkout"
        raise exits.UsageError(f"this installation holds no gallery: {hint}")
    if name is None:
        # All models by subject
        if as_json:
            print(formats.json_line({"models": [_described(one) for one in gallery]}))
            return
        width = max(len(one.name) for one in gallery) + 2 * INDENT
        subject = ""
        for one in gallery:
            if one.subject != subject:
                print(*([""] if subject else []), one.subject, sep="\n" if subject else "")
                subject = one.subject
            line = f"{'':{INDENT}}{one.name:{width - INDENT}}{one.teaches}"
            print(textwrap.fill(line, console.width(), subsequent_indent=" " * width, break_long_words=False))
        if not quiet:
            exits.print_err("`lagcli models NAME` prints a model, `lagcli models NAME -o FILE` copies it")
        return
    model = first_models.find(name)
    if model is None:
        hint = diagnostics.nearest(name, [one.name for one in gallery]) or "`lagcli models` lists them"
        raise exits.UsageError(f"there is no model `{name}` in the gallery; {hint}")
    if output is None and as_json:
        print(formats.json_line({**_described(model), "text": model.text()}))
    elif output is None or output == new_command.STDOUT:
        print(model.text(), end="")
    else:
        # A copy, with its line for editors and the schema beside it
        from lagcli.input import format_schema  # here, as help and lists need none of it

        if os.path.isdir(output):
            output = os.path.join(output, f"{model.name}.yaml")
        head = "" if no_schema else f"{format_schema.EDITOR_LINE}\n"
        is_new = new_command.write(output, head + model.text(), force=force)
        messages = [f"wrote {output}" if is_new else f"{output} is this model already"]
        if not no_schema:
            messages.append(new_command.schema_beside(output))
        exits.print_err_all(() if quiet else filter(None, messages))


def _described(model: GalleryModel) -> dict[str, object]:
    told = {"name": model.name, "subject": model.subject, "title": model.title()}
    return {**told, "teaches": model.teaches, "path": str(model.path)}
