"""`lagcli new`: a commented start for a model; and files for the user to go on with, never over another in silence."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

from lagcli.cli.commands import completing, options
from lagcli.cli.terminal import exits
from lagcli.errors import diagnostics
from lagcli.input.starting import first_models
from lagcli.output.files import atomic_file, formats, write_guard

FIRST = next(iter(first_models.TEMPLATES))
ENDINGS = (".yaml", ".yml")
ANSWERS = 5  # wrong ones that are taken before the questions end
STDOUT = "-"
# More than any model or schema; a file of this size is another one without looking.
MOST = 2**25


@options.command()
def new(
    name: Annotated[
        str | None,
        options.argument("NAME", "the name of the model; NAME.yaml is written, - for standard output"),
    ] = None,
    template: Annotated[
        str | None,
        options.named(
            "TEMPLATE", "particles, coordinates, rolling, mechanism, family or box", completing.templates
        ),
    ] = None,
    force: options.ForceOption = False,
    no_schema: options.NoSchemaOption = False,
    as_json: Annotated[bool, "what was written, as JSON on standard output"] = False,
    quiet: options.QuietOption = False,
) -> None:
    """Write a model with comments, to change into one's own.

    On a terminal what is not given is asked for.
    """
    if template is not None and template not in first_models.TEMPLATES:
        known = diagnostics.listed(list(first_models.TEMPLATES))
        hint = diagnostics.nearest(template, first_models.TEMPLATES) or f"there are {known}"
        raise exits.UsageError(f"there is no template `{template}`; {hint}")
    asks = sys.stdin is not None and sys.stdin.isatty() and sys.stderr.isatty()
    if name is None:
        if not asks:
            raise exits.UsageError("a NAME is missing: `lagcli new NAME` writes NAME.yaml")
        for _ in range(ANSWERS):
            if name := _answer("name of the model: "):
                break
        else:
            raise exits.UsageError("a NAME is missing: `lagcli new NAME` writes NAME.yaml")
    if not name.strip() or os.path.basename(name) in ENDINGS:
        raise exits.UsageError("a model needs a name: `lagcli new NAME` writes NAME.yaml")
    if template is None:
        template = _asked_template() if asks and name != STDOUT else FIRST
    if name == STDOUT:
        print(first_models.text(template, "A new model", for_editors=False), end="")
        return
    stem, ending = os.path.splitext(name)
    path = name if ending.lower() in ENDINGS else f"{name}.yaml"
    title = os.path.basename(stem if ending.lower() in ENDINGS else name)
    if title != title.encode("utf-8", "replace").decode("utf-8"):
        raise exits.UsageError("the name of a model is text in UTF-8")
    text = first_models.text(template, title, for_editors=not no_schema)
    is_new = write(path, text, force=force)
    schema_message = "" if no_schema else schema_beside(path)
    if as_json:
        print(formats.json_line({"path": path, "template": template, "written": is_new}))
    if quiet:
        return
    written = f"wrote {path}, from the template `{template}`"
    exits.print_err(written if is_new else f"{path} is there already, as it would be")
    if schema_message:
        exits.print_err(schema_message)
    if is_new:
        exits.print_err(f"next: lagcli check {shlex.quote(path)}")


def _asked_template() -> str:
    names = list(first_models.TEMPLATES)
    width = max(map(len, names))
    for number, name in enumerate(names, 1):
        exits.print_err(f"  {number}  {name:{width}}  {first_models.TEMPLATES[name]}")
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


def write(
    name: str, text: str, *, force: bool = False, may_replace: Callable[[str], bool] = lambda old: False
) -> bool:
    """Write a text to a file, or to standard output for `-`; False where the file holds this text already.

    may_replace: whether a file with this text may be written over without `force`. Raises `exits.UsageError` where
    another file is there, `write_guard.WriteError` where the file cannot be written.
    """
    if name == STDOUT:
        print(text, end="")
        return True
    target = Path(name)
    with write_guard.writing(name):
        old = _old(target)
        if old == text:
            return False
        if old is not None and not force and not may_replace(old):
            raise exits.UsageError(f"{name} is there already, and another file; --force writes over it")
        pending = atomic_file.PendingFile(target)
        with atomic_file.undone_by(pending.discard):
            pending.path.write_bytes(text.encode())
            pending.commit()
    return True


def schema_beside(model: str) -> str:
    """Write the schema beside a model, where none is; the message about it, or nothing. Raises `WriteError`."""
    from lagcli.input import format_schema

    name = os.path.join(os.path.dirname(model), format_schema.FILE)
    if os.path.lexists(name):
        with write_guard.writing(name):
            same = _old(Path(name)) == format_schema.text()
        return "" if same else f"{name} is of another version; `lagcli schema -o {name}` writes it anew"
    write(name, format_schema.text())
    return f"wrote {name}, by which editors complete and check models"


def _old(target: Path) -> str | None:
    """The text of a file there is; None where there is none, or what is no file to replace."""
    if not target.is_file():
        return None
    with target.open("rb") as file:
        return file.read(MOST).decode("utf-8", "replace")
