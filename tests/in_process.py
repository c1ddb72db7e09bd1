"""Command lines run in this process, with streams of their own."""

import sys
from collections.abc import Callable
from typing import Any

import pytest

from lagcli import __main__ as entry
from lagcli.cli import signals

Command = Callable[..., tuple[str, str, Any]]


@pytest.fixture
def command(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Command:
    """command(*arguments) -> stdout, stderr and exit code."""
    monkeypatch.setattr(signals, "install", lambda: None)

    def call(*arguments: object) -> tuple[str, str, Any]:
        monkeypatch.setattr(sys, "argv", ["lagcli", *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            entry.main()
        return (*capsys.readouterr(), end.value.code)

    return call
