"""Failures to write a file, reported with its name, and refusals of what was asked for."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

from lagcli.output.files import interrupts


class WriteError(Exception):
    """A file could not be written."""


class BadRequest(Exception):
    """Something that was asked for cannot be done; the message names the option."""


@contextlib.contextmanager
def writing(name: str) -> Iterator[None]:
    """Take what fails inside as the writing of `name`. A closed pipe stays what it is. Raises `WriteError`.

    An interrupt inside is an exception, so that what has been written aside is put in order.
    """
    try:
        with interrupts.unwinding():
            yield
    except BrokenPipeError:
        raise
    except OSError as error:
        raise WriteError(f"cannot write {name}: {error.strerror or error}") from error


@contextlib.contextmanager
def drawing(name: str) -> Iterator[None]:
    """Surround what loads matplotlib and writes a figure; matplotlib's remarks on its cache are no answer of ours."""
    import logging

    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    with writing(name):
        yield
