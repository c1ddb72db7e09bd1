"""What redundant rows cost: `python -m tests.benchmarks.redundancy`.

Each redundant model of the gallery, and chains of which each rod is declared twice, beside the model without the
redundant rows: time of an evaluation of the right-hand side, the medians of runs in turns, and their ratio.
"""

from __future__ import annotations

import statistics
from collections.abc import Iterator

import lagcli
from tests.helpers import redundant_models

TURNS = 9
SIZES = (10, 100)
ROWS = 11  # of the table: what is measured is steps

CHAIN = """lagcli: 1
parameters: {{N: {}, g: 9.81}}
particles:
  p[i]: {{for: "i = 1..N", mass: 1, position: "[i, 0, 0]"}}
forces: {{weight: {{to: all, force: [0, -m*g, 0]}}}}
simulation: {{duration: 2}}
holonomic:
  hook: distance(p[1], [0, 0, 0]) = 1
  rod[i]: {{for: "i = 2..N", equation: "distance(p[i], p[i-1]) = 1"}}
"""
TWINS = '  twin[i]: {for: "i = 2..N", equation: "dot(p[i] - p[i-1], p[i] - p[i-1]) = 1"}\n'


def pairs() -> Iterator[tuple[str, str, str]]:
    """Names, texts with redundant rows, texts without."""
    for name in redundant_models.REDUNDANT:
        yield (
            name,
            (redundant_models.MODELS / name).read_text(encoding="utf-8"),
            redundant_models.without(name),
        )
    for size in SIZES:
        chain = CHAIN.format(size)
        yield f"chain of {size} twin rods", chain + TWINS, chain


def cost(text: str) -> float:
    """Microseconds of one evaluation."""
    stats = lagcli.simulate(lagcli.loads(text), samples=ROWS).stats
    return 1e6 * stats.solve_seconds / stats.evaluations


def main() -> None:
    """Print a line for each pair."""
    for name, redundant, plain in pairs():
        costs = [(cost(redundant), cost(plain)) for _ in range(TURNS)]
        one, other = (statistics.median(values) for values in zip(*costs, strict=True))
        print(f"{name:28} {one:8.2f} us beside {other:8.2f} us: {one / other:.2f} times", flush=True)


if __name__ == "__main__":
    main()
