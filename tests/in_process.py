"""Command lines run in this process, with streams of their own."""

import sys

import pytest

from lagcli import __main__ as entry
from lagcli.cli import signals


@pytest.fixture
def command(monkeypatch, capsys):
    """command(*arguments) -> stdout, stderr and exit code."""
    monkeypatch.setattr(signals, "install", lambda: None)

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["lagcli", *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            entry.main()
        return (*capsys.readouterr(), end.value.code)

    return call
