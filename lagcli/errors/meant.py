"""Words of other programs and of paper, with what is meant by them here: the tables of `meant.toml`.

They serve hints in messages, so that a command that succeeds does not read the file.
"""

from __future__ import annotations

import functools
import pathlib


@functools.cache
def _tables() -> dict[str, dict[str, list[str]]]:
    import tomllib

    return tomllib.loads(pathlib.Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))


def words(table: str) -> dict[str, str]:
    """Each word of a table with what is meant by it; no word of a table that there is not."""
    meanings = _tables().get(table, {})
    return {word: meaning for meaning, listed in meanings.items() for word in listed}
