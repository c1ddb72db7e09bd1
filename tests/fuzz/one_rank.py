"""`python -m tests.fuzz.one_rank --models 500`: what commands say of the rank of random models near singular places."""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from tests.physics.test_one_rank import disagreements


def main() -> int:
    """Print each model of which commands contradict each other or the closed form; 1 if there is one."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--models", type=int, default=500)
    parser.add_argument("--first", type=int, default=0)
    chosen = parser.parse_args()
    bad = 0
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(chosen.first, chosen.first + chosen.models):
            found = disagreements(seed, Path(folder) / "model.yaml")
            bad += bool(found)
            if found:
                print(seed, *found, sep="\n  ", flush=True)
    print(f"{bad} of {chosen.models} models with contradictions")
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())
