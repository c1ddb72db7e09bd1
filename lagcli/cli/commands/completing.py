"""Candidates for a word of the command line: model files, names in them, and names of the program.

A completion is asked for while somebody types: nothing is computed for it, a model that is broken has the names that
can be read, and what cannot be read has none. It is never an error.
"""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING

import typer

from lagcli.output.files import formats

if TYPE_CHECKING:
    from lagcli.input.starting.model_outline import Outline

Described = list[tuple[str, str]]

ENDINGS = (".yaml", ".yml")
TABLES = tuple(f".{ending}" for ending in formats.FORMATS)
# Tables whose names of columns stand in the first line, with what is between them.
_PLAIN_TABLES = {f".{ending}": separator for ending, separator in formats.PLAIN.items()}
MOST_HEADER = 2**18  # characters of a first line that are read
MOST_FILES = 2000  # entries of a folder that are looked at
DEEPEST = 8  # folders that are gone down where each holds one folder only
# Characters that mean something to a shell inside of quotes too, or end the line: no candidate holds them.
_UNSAFE = re.compile(r"""['"\\$`;&|<>!\x00-\x1f\x7f]""")
_SPECIAL = re.compile(r"[()\[\]{}*?#~ ]")
# Where each shell leaves the words typed so far.
_TYPED = ("COMP_WORDS", "_TYPER_COMPLETE_ARGS")


def model_files(ctx: typer.Context, incomplete: str) -> list[str]:
    """Files of models and folders."""
    return _shown(_reached(incomplete, ENDINGS))


def run_files(ctx: typer.Context, incomplete: str) -> list[str]:
    """Files of models, tables and folders."""
    return _shown(_reached(incomplete, (*ENDINGS, *TABLES)))


def columns(ctx: typer.Context, incomplete: str) -> list[str]:
    """Columns of the table that is named, or of a table of the model, after the last comma."""
    for path in _paths(ctx, tuple(_PLAIN_TABLES)):
        with contextlib.suppress(OSError, ValueError), open(path, encoding="utf-8", newline="") as file:
            separator = _PLAIN_TABLES[os.path.splitext(path)[1].lower()]
            names = file.readline(MOST_HEADER).strip().split(separator)
            return _listed((name.strip('"') for name in names), incomplete)
    return _listed((*_outline(ctx).columns(), "lambda.*", "R.*"), incomplete)


def _of_outline(find: Callable[[Outline], Iterable[str]]) -> Callable[[typer.Context, str], list[str]]:
    """A completion with names in the model; a family has no name of its own to give."""

    def completed(ctx: typer.Context, incomplete: str) -> list[str]:
        names = find(_outline(ctx))
        return _shown(name for name in names if name.startswith(incomplete) and "[" not in name)

    return completed


differential = _of_outline(lambda found: found.of("differential"))
holonomic = _of_outline(lambda found: found.of("holonomic"))
# The beginnings of NAME=VALUE.
multipliers = _of_outline(lambda found: [f"{name}=" for name in found.of("differential")])
settings = _of_outline(lambda found: [f"{name}=" for name in found.settable()])


def parameters(ctx: typer.Context, incomplete: str) -> list[str]:
    """Parameters of the model, after the last comma."""
    return _listed(_outline(ctx).of("parameters"), incomplete)


def gallery_names(ctx: typer.Context, incomplete: str) -> Described:
    """The models of the gallery."""
    from lagcli.input.starting import first_models

    return [(m.name, m.teaches) for m in first_models.models() if m.name.startswith(incomplete)]


def templates(ctx: typer.Context, incomplete: str) -> Described:
    """The templates of `new`."""
    from lagcli.input.starting import first_models

    return [item for item in first_models.TEMPLATES.items() if item[0].startswith(incomplete)]


def codes(ctx: typer.Context, incomplete: str) -> list[str]:
    """The codes of messages."""
    from lagcli.errors import catalogue

    return [code for code in catalogue.codes() if code.startswith(incomplete)]


def _listed(names: Iterable[str], incomplete: str) -> list[str]:
    before, comma, start = incomplete.rpartition(",")
    return _shown(f"{before}{comma}{name}" for name in dict.fromkeys(names) if name.startswith(start))


def _outline(ctx: typer.Context) -> Outline:
    """The names in the model of the command line, no names where there is none to read."""
    from lagcli.input.starting import model_outline

    for path in _paths(ctx, ENDINGS):
        with contextlib.suppress(OSError, ValueError), open(path, "rb") as file:
            # One byte more, by which a file that is too long is known.
            return model_outline.read(file.read(model_outline.MAX_BYTES + 1))
    return model_outline.EMPTY


def _paths(ctx: typer.Context, endings: tuple[str, ...]) -> Iterator[str]:
    """The files that may be meant: those that were taken for it, else what looks like one, also after the cursor."""
    for key in ("model", "models", "files", "source"):
        given = ctx.params.get(key)
        named = given if isinstance(given, (list, tuple)) else (given,)
        words = [str(name) for name in named if name]
        for word in words:
            # A model may have any ending, a table is known by its own.
            is_model = endings == ENDINGS and not word.lower().endswith(TABLES)
            if (word.lower().endswith(endings) or is_model) and os.path.isfile(word):
                yield word
    for variable in _TYPED:
        for word in os.environ.get(variable, "").split():
            if word.lower().endswith(endings) and os.path.isfile(word):
                yield word


def _reached(incomplete: str, endings: tuple[str, ...]) -> list[str]:
    """Files with these endings and folders; in place of a folder that is alone what is in it."""
    found = list(_files(incomplete, endings))
    for _ in range(DEEPEST):
        if len(found) != 1 or not found[0].endswith("/"):
            break
        # A shell takes a candidate that is alone for a whole word: it is the files in the folder that are meant.
        found = list(_files(found[0], endings)) or found
        if found[0].endswith("/") and len(found) == 1 and found[0] == incomplete:
            break
    return found


def _files(incomplete: str, endings: tuple[str, ...]) -> Iterator[str]:
    """Files and folders whose names go on from what was typed, in the order of the alphabet."""
    head = max(incomplete.rfind("/"), incomplete.rfind(os.sep)) + 1
    folder, start = incomplete[:head], incomplete[head:]
    found = []
    with contextlib.suppress(OSError, ValueError), os.scandir(os.path.expanduser(folder) or ".") as entries:
        for entry, _ in zip(entries, range(MOST_FILES), strict=False):
            if not entry.name.startswith(start) or (entry.name.startswith(".") and not start):
                continue
            if entry.is_dir():
                found.append(f"{folder}{entry.name}/")
            elif entry.name.lower().endswith(endings):
                found.append(f"{folder}{entry.name}")
    return iter(sorted(found))


def _shown(candidates: Iterable[str]) -> list[str]:
    """Candidates as the shell takes them: bash inserts what it gets, so that its special characters are escaped."""
    safe = [text for text in candidates if not _UNSAFE.search(text)]
    typed = os.environ.get("COMP_WORDS", "").rsplit("\n", 1)[-1]
    if os.environ.get("_LAGCLI_COMPLETE") == "complete_bash" and typed[:1] not in ("'", '"'):
        return [_SPECIAL.sub(r"\\\g<0>", text) for text in safe]
    return safe
