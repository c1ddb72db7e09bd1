"""The words of other programs in `diagnostics.toml` lead to what is there."""

from __future__ import annotations

import pytest

from lagcli.errors import diagnostics
from lagcli.input import keys

TABLES = diagnostics._tables()


@pytest.mark.parametrize("table", TABLES)
def test_a_word_has_one_meaning(table: str) -> None:
    listed = [word for words in TABLES[table].values() for word in words]
    assert sorted(set(listed)) == sorted(listed)


@pytest.mark.parametrize("table", [name for name in TABLES if name.startswith("keys of ")])
def test_words_for_keys_lead_to_keys_and_are_none(table: str) -> None:
    owner = keys.FORMAT.key(table.removeprefix("keys of "))
    assert set(TABLES[table]) <= set(owner.names)
    assert not set(diagnostics.meant(table)) & set(owner.names)


def test_every_table_of_keys_and_sentences_is_of_a_section() -> None:
    owners = {name.rpartition(" of ")[2] for name in TABLES if name.startswith(("keys of ", "sentences of "))}
    assert owners <= set(keys.FORMAT.names)
    assert set(diagnostics.meant("examples")) <= set(keys.FORMAT.names)
    assert not diagnostics.meant("no table of this name")
