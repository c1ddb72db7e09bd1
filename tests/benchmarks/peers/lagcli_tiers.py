"""lagcli as a program among others: a call of `simulate` from Python, with `--compile` never or always."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import protocol

import lagcli

# A call of next to no steps: what a call costs by itself.
NO_STEPS, SHORT = "no steps", 1e-9


def build(problem: dict[str, Any]) -> protocol.Solver:
    """A model and its calls."""
    model = lagcli.loads(problem["model"])

    def prepare(setting: str) -> protocol.Run:
        rtol = 1e-6 if setting == NO_STEPS else float(setting)
        duration = problem["duration"] * (SHORT if setting == NO_STEPS else 1.0)

        def run() -> Any:
            made = lagcli.simulate(
                model, duration=duration, samples=2, rtol=rtol, atol=rtol / 100, compile=sys.argv[1]
            )
            return np.array([made[name][-1] for name in problem["columns"]])

        return run

    return protocol.Solver(protocol.tolerances(3, 13), prepare)


if __name__ == "__main__":
    protocol.serve(build)
