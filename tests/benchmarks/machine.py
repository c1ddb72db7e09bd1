"""On what was measured: processor, cores, versions; no names of hosts or folders."""

from __future__ import annotations

import datetime
import os
import platform
from importlib import metadata
from pathlib import Path
from typing import Any

import lagcli


def description(peers: dict[str, str]) -> dict[str, Any]:
    """Date, processor, system, and versions of what lagcli runs on and of the `peers`."""
    own = {name: metadata.version(name) for name in ("casadi", "numpy", "scipy", "sympy")}
    return {
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
        "processor": _processor(),
        "cores": os.cpu_count(),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "versions": {"lagcli": lagcli.__version__, **own},
        "peers": peers,
    }


def _processor() -> str:
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:  # not Linux
        return platform.processor() or platform.machine()
    names = [line.partition(":")[2].strip() for line in text.splitlines() if line.startswith("model name")]
    return names[0] if names else platform.machine()
