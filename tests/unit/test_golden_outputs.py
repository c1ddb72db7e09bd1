"""The goldens notice what has changed, and not how numbers are rounded."""

import json
from pathlib import Path

import pytest

from tests import goldens
from tests.helpers import golden_outputs

MODELS = Path(__file__).resolve().parents[2] / "models"
FOUND = {"exit": 0, "/at/a.z": -1.0, "/force": 2e4, "/type": "minimum", "/index": 0}


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"/at/a.z": -1.0 + 1e-9, "/force": 2e4 * (1 + 1e-9)}, 0),
        ({"/at/a.z": -1.0 + 1e-5}, 1),
        ({"/force": 2e4 * (1 + 1e-5)}, 1),
        ({"/type": "saddle", "/index": 1}, 2),
        ({"/more": None}, 1),
    ],
)
def test_leaves_are_compared_but_for_rounding(tmp_path: Path, change: dict[str, object], told: int) -> None:
    old, new = tmp_path / "old.values", tmp_path / "new.values"
    old.write_text(json.dumps(FOUND), encoding="utf-8")
    new.write_text(json.dumps(FOUND | change), encoding="utf-8")
    assert len(goldens.agree(old, new)) == told
    assert len(goldens.agree(new, old)) == told


def test_a_drawing_is_known_by_its_texts_and_lines(tmp_path: Path) -> None:
    said = []
    for k, columns in enumerate(("a.x", "a.x,a.z", "a.x")):
        path = tmp_path / f"{k}.txt"
        golden_outputs.drawing(
            "plot", MODELS / "pendulum.yaml", "--y", columns, "--samples", "5", "--duration", "1"
        )(path)
        said.append(path)
    assert goldens.agree(said[0], said[2]) == []
    assert "+a.z" in goldens.agree(said[0], said[1])
