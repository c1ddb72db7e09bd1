"""Commands do not contradict each other about the rank of one model, nor the closed form."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.helpers import near_singular
from tests.helpers.in_process import run

pytestmark = pytest.mark.numeric

CLEAR = 3e-6  # nearer rows are refused by runs, `linear.rank`


def answers(path: Path) -> dict[str, tuple[int, str, str]]:
    commands = {
        "dof": ("dof", path, "--json"),
        "check": ("check", path, "--json"),
        "displacements": ("displacements", path, "--json"),
        "equilibrium": ("equilibrium", path, "--json", "--starts", "1"),
        "simulate": ("simulate", path),
        "modes": ("modes", path, "--about", "start"),
        "compare": ("compare", path),
    }
    found = {}
    for name, arguments in commands.items():
        out, err, code = run(*arguments)
        assert code in (0, 1, 3, 4), (name, code, err)
        found[name] = (code, out, err)
    return found


def disagreements(seed: int, path: Path) -> list[str]:
    """Sentences on what commands say of a random model against its rank, or against each other."""
    model = near_singular.model(seed)
    path.write_text(model.text, encoding="utf-8")
    told = answers(path)
    is_full, is_undecided = model.rank == model.rows, "no gap" in told["dof"][2]
    counted = json.loads(told["dof"][1])
    rank = json.loads(told["displacements"][1] or "{}").get("rank")
    wrong = [] if rank == model.rank and not is_undecided else [f"rank {rank}: {told['dof'][2]}"]
    if is_full and counted["velocity_dof"] not in (None, counted["coordinates"] - model.rows):
        wrong.append(f"dof: {counted}")
    for name in ("simulate", "modes", "compare", "equilibrium"):
        text = told[name][1] + told[name][2]
        false = ["cannot be decided", "are dependent there" if is_full else "are independent at the start"]
        if any(words in text for words in false):
            wrong.append(f"{name}: {text}")
        is_refused = model.is_everywhere or name != "equilibrium"
        if is_full and model.distance < CLEAR / 3 and is_refused and "but within" not in text:
            wrong.append(f"{name}: {text}")
    return wrong


@pytest.mark.parametrize("seed", range(10))
def test_all_commands_state_one_rank(seed: int, tmp_path: Path) -> None:
    assert disagreements(seed, tmp_path / "model.yaml") == []
