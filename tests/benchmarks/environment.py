"""The peers: an environment of their own, made once in a folder, where their scripts run as processes."""

from __future__ import annotations

import dataclasses
import json
import os
import subprocess
import sys
import time
import venv
from pathlib import Path
from typing import Any

PEERS = Path(__file__).parent / "peers"
# One thread, as lagcli has: small matrices gain nothing by more, and lose where threads wait for each other.
THREADS = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
SETUP_SECONDS = 30  # to start, to read the problem, beyond the limit of a case


@dataclasses.dataclass(frozen=True, slots=True)
class Peer:
    """Another program: its name in tables, its script, and what the script is told."""

    key: str
    name: str
    script: str
    arguments: tuple[str, ...] = ()


ALL = (
    Peer("exudyn", "Exudyn", "exudyn_solver.py"),
    Peer("cvodes", "CasADi CVODES", "casadi_cvodes.py"),
    Peer("sympy", "SymPy + SciPy", "sympy_scipy.py"),
    Peer("lagranges-method", "SymPy LagrangesMethod + SciPy", "sympy_scipy.py", ("lagranges-method",)),
)


@dataclasses.dataclass(frozen=True, slots=True)
class Environment:
    """The Python of the peers."""

    python: Path

    def versions(self) -> dict[str, str]:
        """Packages and their versions."""
        done = subprocess.run(
            [self.python, "-m", "pip", "list", "--format", "json", "--disable-pip-version-check"],
            capture_output=True,
            text=True,
            check=True,
        )
        wanted = {"exudyn", "casadi", "numpy", "scipy", "sympy"}
        return {row["name"]: row["version"] for row in json.loads(done.stdout) if row["name"] in wanted}

    def ask(self, peer: Peer, question: dict[str, Any], limit: float) -> dict[str, Any]:
        """The last answer of a peer, with a `reason` where it did not reach the wanted error."""
        answers, ended = self._answers(peer, question, limit)
        reached = [answer for answer in answers if answer["reached"]]
        if reached:
            return {**reached[-1], "reason": None}
        # The most accurate of the attempts says most about what the time would have been.
        best = min(answers, key=lambda a: a["error"] if a["error"] is not None else float("inf"), default={})
        over = f"not within {limit:.0f} s" if ended in ("in time", "over time") else ended
        return {**best, "reached": False, "reason": over if best else f"not run: {over}"}

    def _answers(
        self, peer: Peer, question: dict[str, Any], limit: float
    ) -> tuple[list[dict[str, Any]], str]:
        try:
            done = subprocess.run(
                [self.python, PEERS / peer.script, *peer.arguments],
                input=json.dumps({**question, "limit": limit}),
                capture_output=True,
                text=True,
                env={**os.environ, **THREADS},
                timeout=limit + SETUP_SECONDS,
                check=False,
            )
        except subprocess.TimeoutExpired as late:
            said = late.stdout or b""
            return _parsed(said.decode() if isinstance(said, bytes) else said), "over time"
        if done.returncode:
            why = (done.stderr.strip().splitlines() or ["no message"])[-1]
            return _parsed(done.stdout), f"ended with: {why[:80]}"
        return _parsed(done.stdout), "in time"

    def whole(self, peer: Peer, question: dict[str, Any], limit: float) -> float | None:
        """Seconds of a whole process that solves and writes, or None over the limit."""
        began = time.perf_counter()
        try:
            subprocess.run(
                [self.python, PEERS / peer.script, *peer.arguments],
                input=json.dumps(question),
                text=True,
                env={**os.environ, **THREADS},
                timeout=limit,
                stdout=subprocess.DEVNULL,
                check=True,
            )
        except subprocess.TimeoutExpired:
            return None
        return time.perf_counter() - began


def _parsed(text: str) -> list[dict[str, Any]]:
    return [json.loads(line) for line in text.splitlines() if line.startswith("{") and line.endswith("}")]


def make(folder: Path) -> Environment:
    """The environment in `folder`, made and filled where it is not there yet."""
    python = folder / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")
    complete = folder / "complete.txt"
    requirements = (PEERS / "requirements.txt").read_text(encoding="utf-8")
    if not complete.exists() or complete.read_text(encoding="utf-8") != requirements:
        venv.create(folder, clear=True, with_pip=True)
        command: list[str | Path] = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
        subprocess.run([*command, "-r", PEERS / "requirements.txt"], check=True)
        complete.write_text(requirements, encoding="utf-8")
    return Environment(python)
