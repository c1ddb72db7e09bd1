"""`lagcli.load`: a model in a file or a text."""

from __future__ import annotations

import os
from collections.abc import Mapping

from lagcli import progress, yaml_tree
from lagcli.input import document
from lagcli.model.model import Model

Path = str | os.PathLike[str]


@progress.phase("reading the model")
def load(path: Path, parameters: Mapping[str, object] | None = None) -> Model:
    """Return the model in a file (`-` for standard input).

    `parameters` overrides parameters and initial values, `{"m": 2, "theta.value": "pi/3"}`.
    Raises `ModelError` with every error of the file, `OverrideError`, `OSError`.
    """
    name = "<stdin>" if os.fspath(path) == "-" else os.fspath(path)
    return document.read(yaml_tree.read(path), name, parameters)


def loads(text: str, parameters: Mapping[str, object] | None = None) -> Model:
    """Return the model in a text; otherwise as `load`."""
    return document.read(text, "<text>", parameters)


def as_model(model: Model | Path) -> Model:
    """The model itself, or that in a file."""
    return load(model) if isinstance(model, (str, os.PathLike)) else model
