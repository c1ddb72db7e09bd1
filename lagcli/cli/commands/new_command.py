"""`lagcli new`: a commented start for a model."""

from __future__ import annotations

import os
import shlex
import sys
from typing import Annotated

import typer

from lagcli.cli.commands import completing, new_files, options
from lagcli.cli.terminal import exits
from lagcli.errors import diagnostics
from lagcli.input.starting import model_templates
from lagcli.output.files import formats

FIRST = next(iter(model_templates.TEMPLATES))
ENDINGS = (".yaml", ".yml")
ANSWERS = 5  # wrong ones that are taken before the questions end


@exits.command
def new(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="NAME", help="the name of the model; NAME.yaml is written, - for standard output"
        ),
    ] = None,
    template: Annotated[
        str | None,
        typer.Option(
            metavar="TEMPLATE",
            help="particles, coordinates, rolling, mechanism, family or box",
            autocompletion=completing.templates,
        ),
    ] = None,
    force: options.ForceOption = False,
    no_schema: options.NoSchemaOption = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="what was written, as JSON on standard output")
    ] = False,
    quiet: options.QuietOption = False,
    debug: options.DebugOption = False,
) -> None:
    """Write a model with comments, to change into one's own.

    On a terminal what is not given is asked for.
    """
    if template is not None and template not in model_templates.TEMPLATES:
        known = diagnostics.listed(list(model_templates.TEMPLATES))
        hint = diagnostics.nearest(template, model_templates.TEMPLATES) or f"there are {known}"
        raise exits.UsageError(f"there is no template `{template}`; {hint}")
    asks = sys.stdin is not None and sys.stdin.isatty() and sys.stderr.isatty()
    if name is None:
        if not asks:
            raise exits.UsageError("a NAME is missing: `lagcli new NAME` writes NAME.yaml")
        name = _asked_name()
    if not name.strip() or os.path.basename(name) in ENDINGS:
        raise exits.UsageError("a model needs a name: `lagcli new NAME` writes NAME.yaml")
    if template is None:
        template = _asked_template() if asks and name != new_files.STDOUT else FIRST
    if name == new_files.STDOUT:
        print(model_templates.text(template, "A new model", for_editors=False), end="")
        return
    _write(name, template, not no_schema, force, as_json, quiet)


def _write(name: str, template: str, with_schema: bool, force: bool, as_json: bool, quiet: bool) -> None:
    """Write NAME.yaml, and the schema beside it. Raises `exits.UsageError`, `write_guard.WriteError`."""
    stem, ending = os.path.splitext(name)
    path = name if ending.lower() in ENDINGS else f"{name}.yaml"
    title = os.path.basename(stem if ending.lower() in ENDINGS else name)
    if title != title.encode("utf-8", "replace").decode("utf-8"):
        raise exits.UsageError("the name of a model is text in UTF-8")
    text = model_templates.text(template, title, for_editors=with_schema)
    is_new = new_files.write(path, text, force=force)
    schema_message = new_files.schema_beside(path) if with_schema else ""
    if as_json:
        print(formats.json_line({"path": path, "template": template, "written": is_new}))
    if quiet:
        return
    exits.print_err(
        f"wrote {path}, from the template `{template}`"
        if is_new
        else f"{path} is there already, as it would be"
    )
    if schema_message:
        exits.print_err(schema_message)
    if is_new:
        exits.print_err(f"next: lagcli check {shlex.quote(path)}")


def _asked_name() -> str:
    for _ in range(ANSWERS):
        answer = _answer("name of the model: ")
        if answer:
            return answer
    raise exits.UsageError("a NAME is missing: `lagcli new NAME` writes NAME.yaml")


def _asked_template() -> str:
    names = list(model_templates.TEMPLATES)
    width = max(map(len, names))
    for number, name in enumerate(names, 1):
        exits.print_err(f"  {number}  {name:{width}}  {model_templates.TEMPLATES[name]}")
    for _ in range(ANSWERS):
        answer = _answer(f"template (1 to {len(names)}, or its name; {FIRST}): ")
        if not answer:
            return FIRST
        if answer.isdecimal() and 1 <= int(answer) <= len(names):
            return names[int(answer) - 1]
        if answer in names:
            return answer
        exits.print_err(f"there is no template `{answer}`")
    raise exits.UsageError("no template was chosen; --template NAME names one")


def _answer(question: str) -> str:
    """A line of the terminal, stripped. Raises `exits.UsageError` at its end."""
    print(question, end="", file=sys.stderr, flush=True)
    line = sys.stdin.readline()
    if not line:
        exits.print_err("")
        raise exits.UsageError("no answer; nothing was written")
    return line.strip()
