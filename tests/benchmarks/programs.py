"""The programs: each is a process of its own, by a Python that has the extra `bench`; what is not there is left out."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

ROOT = Path(__file__).parents[2]
PEERS = Path(__file__).parent / "peers"
# One thread: small matrices gain nothing by more, and lose where threads wait for each other.
THREADS = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")

# What lagcli itself needs is of the same version as beside it.
HERE = frozenset({"lagcli", "casadi", "sympy"})


class Program(NamedTuple):
    """A program: its name in tables, its script, what that is told, and the package it needs."""

    name: str
    script: str
    argument: str
    package: str

    @property
    def is_own(self) -> bool:
        return self.package == "lagcli"

    def solves(self, kind: str) -> bool:
        """True for problems of a kind that the program has: others have no contacts, or no rolling by velocities."""
        return self.is_own or (self.package == "mujoco") == (kind == "spheres") or kind == "network"


ALL: dict[str, Program] = {
    "plain": Program("lagcli, plain", "lagcli_tiers.py", "never", "lagcli"),
    "native": Program("lagcli, native", "lagcli_tiers.py", "always", "lagcli"),
    "heyoka": Program("heyoka", "heyoka_taylor.py", "default", "heyoka"),
    "heyoka-compact": Program("heyoka, compact mode", "heyoka_taylor.py", "compact", "heyoka"),
    "cvodes": Program("CVODES (CasADi)", "casadi_cvodes.py", "", "casadi"),
    "tsit5": Program("diffrax, Tsit5", "diffrax_jax.py", "Tsit5", "diffrax"),
    "dopri8": Program("diffrax, Dopri8", "diffrax_jax.py", "Dopri8", "diffrax"),
    "mujoco": Program("MuJoCo", "mujoco_bodies.py", "", "mujoco"),
    "scipy": Program("SymPy + SciPy", "sympy_scipy.py", "", "sympy"),
}


def versions(python: str) -> dict[str, str]:
    """The packages of the programs that are installed for a Python, with their versions."""
    names = sorted({"jax", *(program.package for program in ALL.values())} - HERE)
    code = (
        "import json, sys; from importlib import metadata\n"
        "have = {d.metadata['Name']: d.version for d in metadata.distributions()}\n"
        "print(json.dumps({name: have[name] for name in sys.argv[1:] if name in have}))"
    )
    done = subprocess.run([python, "-c", code, *names], capture_output=True, text=True, check=True)
    found: dict[str, str] = json.loads(done.stdout)
    return found


def command(program: Program, python: str) -> list[str]:
    """What starts a program."""
    return [
        sys.executable if program.package in HERE else python,
        str(PEERS / program.script),
        program.argument,
    ]


def surroundings(cache: Path) -> dict[str, str]:
    """The environment of a program: one thread, and all that it keeps goes into a folder."""
    folders = {
        "XDG_CACHE_HOME": cache,
        "LAGCLI_CACHE": cache / "lagcli",
        "JAX_COMPILATION_CACHE_DIR": cache / "jax",
    }
    everything = {
        "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0",
        "JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES": "-1",
    }
    path = os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
    return {
        **os.environ,
        **THREADS,
        **{key: str(each) for key, each in folders.items()},
        **everything,
        "PYTHONPATH": path,
    }


class Process:
    """A program that solves one problem with settings; `settings` and `seconds` are its first answer."""

    def __init__(self, program: Program, python: str, cache: Path, problem: dict[str, Any]) -> None:
        self._process = subprocess.Popen(
            command(program, python),
            env=surroundings(cache),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        begun = self.ask(problem)
        self.settings: Sequence[str] = begun["settings"]
        self.seconds: float = begun["seconds"]

    def ask(self, question: Any) -> dict[str, Any]:
        """The answer to a line. Raises `RuntimeError` where the program has ended."""
        reader, writer = self._process.stdout, self._process.stdin
        if reader is None or writer is None:
            raise RuntimeError("no pipes")
        writer.write(json.dumps(question) + "\n")
        writer.flush()
        for line in reader:
            if line.startswith("{"):  # other lines are what a library says
                answer: dict[str, Any] = json.loads(line)
                return answer
        raise RuntimeError(f"{self._process.args!r} ended")

    def __enter__(self) -> Process:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._process.stdin is not None:
            self._process.stdin.close()
        self._process.wait()


class Cost(NamedTuple):
    """Seconds of the processor, in all threads, and of the clock."""

    processor: float
    wall: float


def cost(arguments: Sequence[str], cache: Path, asked: str = "") -> Cost:
    """The cost of a process from its start to its end. Raises `subprocess.CalledProcessError`."""
    began = time.perf_counter()
    process = subprocess.Popen(
        arguments,
        env=surroundings(cache),
        cwd=cache,
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
    )
    if process.stdin is not None:
        process.stdin.write(asked)
        process.stdin.close()
    _, status, spent = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, arguments)
    return Cost(spent.ru_utime + spent.ru_stime, time.perf_counter() - began)
