"""Words on one-sided constraints beside a count, which leaves them out."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.helpers import in_process

BALL = """
lagcli: 1
particles: {a: {mass: 1, position: [0, 0, 0]}}
holonomic: {plane: "a.y = 0"}
"""


@pytest.mark.parametrize("arguments", [("dof", "m.yaml", "--explain"), ("check", "m.yaml")])
def test_a_count_says_that_contacts_are_left_out(
    arguments: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("m.yaml").write_text(BALL, encoding="utf-8")
    assert "one-sided" not in in_process.run(*arguments)[0]
    Path("m.yaml").write_text(BALL + 'inequality: {floor: "a.z >= 0"}\n', encoding="utf-8")
    out = in_process.run(*arguments)[0]
    assert "3N - s = 3 - 1 = 2" in out
    assert "1 one-sided constraint not counted; `displacements` tells what closed contacts leave free" in out
