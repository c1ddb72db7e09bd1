"""The results as Markdown and as a figure."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from . import programs
from .contest import WANTED, reached

BEGIN, END = "<!-- measured: begin -->", "<!-- measured: end -->"
NAMES = {key: program.name for key, program in programs.ALL.items()}
STEPS_WANTED = 1e-9


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def seconds(value: float | None) -> str:
    """A time in the unit that suits it."""
    if value is None:
        return "-"
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if value >= size:
            return f"{value / size:.3g} {unit}" if value < 1000 * size else f"{value / size:.0f} {unit}"
    return f"{value * 1e9:.0f} ns"


def _ratio(value: float, target: float) -> str:
    return f"{value:.2f} ({'≤' if value <= target else '>'} {target:g})"


def _links(count: int) -> str:
    return f"{count:,}".replace(",", " ")


def steps(results: dict[str, Any]) -> str:
    """lagcli beside the yardstick."""
    head = ["links", "rod as", "yardstick, a step", "lagcli, a step", "ratio", "step, a link"]
    rows = [
        [
            _links(line["links"]),
            "`distance`" if line["rod"] == "distance" else "`dot`",
            seconds(line["yardstick_step"]),
            seconds(line["step"]),
            _ratio(line["step_ratio"], line["step_target"]),
            seconds(line["step"] / line["links"]),
        ]
        for line in results["steps"]
    ]
    return _table(head, rows)


def build(results: dict[str, Any]) -> str:
    """Read, count, compile."""
    head = ["model", "free coordinates", "read", "count", "compile", "together", "target", "a step", "memory"]
    head += ["process"]
    return _table(head, [_build_row(line) for line in results["build"]])


def _build_row(line: dict[str, Any]) -> list[str]:
    size = line["size"]
    name = f"chain, {_links(size)} links" if line["kind"] == "chain" else f"cloth, {size} x {size}"
    if line.get("reason"):
        return [name, line["reason"], *["-"] * 8]
    memory = "-" if line["peak_gigabytes"] is None else f"{line['peak_gigabytes']:.2f} GB"
    target = "-" if line["target"] is None else f"{line['target']:g} s"
    stages = [seconds(line[f"{stage}_seconds"]) for stage in ("read", "count", "compile", "total")]
    freedoms = "undecided" if line["freedoms"] is None else _links(line["freedoms"])
    return [
        name,
        freedoms,
        *stages,
        target,
        seconds(line["step_seconds"]),
        memory,
        seconds(line["process_seconds"]),
    ]


def contest(results: dict[str, Any]) -> str:
    """lagcli beside other programs: the time that an error takes, and the least error with its time."""
    wanted = [f"{each:.0e}".replace("e-0", "e-") for each in WANTED]
    head = ["motion", "program", "equations, compiling", *wanted, "most accurate", "spread"]
    rows = []
    for case in results["contest"].values():
        name = f"{case['case']}, {case['duration']:g} s"
        for key, answer in case["answers"].items():
            rows.append([name, NAMES[key], *_answer(answer)])
            name = ""
    return _table(head, rows)


def _answer(answer: dict[str, Any]) -> list[str]:
    attempts = answer["attempts"]
    shown = [reached(attempts, each) for each in WANTED]
    best = min(attempts, key=lambda each: math.inf if each["error"] is None else each["error"])
    asked = [each for each in [*shown, best] if each is not None]
    compiled = max(each["compile"] for each in [attempts[0], *asked])
    return [
        seconds(answer["equations"] + compiled),
        *(seconds(each and each["seconds"]) for each in shown),
        f"{best['error']:.0e} in {seconds(best['seconds'])}",
        f"{max(each['spread'] for each in asked):.0%}",
    ]


def whole(results: dict[str, Any]) -> str:
    """Whole processes."""
    head, rows = ["motion", "program", "nothing kept", "with what was kept"], []
    for case in results["whole"]:
        name = case["case"]
        for key, times in case["programs"].items():
            rows.append([name, NAMES.get(key, key), seconds(times["cold"]), seconds(times["warm"])])
            name = ""
    return _table(head, rows)


def roofline(results: dict[str, Any]) -> str:
    """Steps alone beside heyoka, and operations of a step over its time in parts of the peaks."""
    found = results["roofline"]
    head = [
        "motion",
        "tier",
        "a step",
        "steps to 1e-9",
        "steps alone",
        "heyoka",
        "operations a step",
        "GFlop/s",
    ]
    head += ["of one by one", "of all units"]
    heyoka = {
        case["case"]: reached(case["answers"].get("heyoka", {}).get("attempts", ()), STEPS_WANTED)
        for case in results["contest"].values()
    }
    rows = []
    for case in found["cases"]:
        for tier in (tier for tier in ("plain", "native") if tier in case):
            rate, other = case["operations"] / case[tier], heyoka[case["case"]]
            rows.append(
                [
                    case["case"] if tier == "plain" else "",
                    tier,
                    seconds(case[tier]),
                    str(case["tries"]),
                    seconds(case["tries"] * case[tier]),
                    seconds(other and other["seconds"]),
                    _links(case["operations"]),
                    f"{rate / 1e9:.2f}",
                    *(f"{rate / peak:.1%}" if peak else "-" for peak in (found["scalar"], found["matrix"])),
                ]
            )
    peaks = [f"{found[key] / 1e9:.1f} GFlop/s" if found[key] else "-" for key in ("scalar", "matrix")]
    rows.append(["peaks of one core", *[""] * 7, *peaks])
    return _table(head, rows)


# Title, what it is made of, and how.
PARTS: tuple[tuple[str, str, Callable[[dict[str, Any]], str]], ...] = (
    ("Beside other programs", "contest", contest),
    ("A whole process", "whole", whole),
    ("Steps alone, and what one core could do", "roofline", roofline),
    ("Beside the yardstick", "steps", steps),
    ("Large models", "build", build),
)


def _machine(made: dict[str, Any]) -> str:
    own = ", ".join(f"{name} {version}" for name, version in made["versions"].items())
    peers = ", ".join(f"{name} {version}" for name, version in made["peers"].items())
    system = f"{made['processor']}, {made['cores']} cores, {made['system']}"
    text = f"{made['date']}; {system}; Python {made['python']}, {own}"
    text += f"; others: {peers}" if peers else ""
    if made["missing"]:
        text += f"; not installed and left out: {', '.join(made['missing'])}"
    return f"{text}; `{made['command']}`."


def sections(results: dict[str, Any]) -> Iterator[str]:
    """The measured part of the page: each machine is named after the last of its tables."""
    shown = [(title, part, make) for title, part, make in PARTS if results.get(part)]
    machines = [results["machines"][part] for _, part, _ in shown]
    for (title, _, make), made, following in zip(shown, machines, [*machines[1:], None], strict=True):
        yield f"### {title}"
        yield make(results)
        if made != following:
            yield f"Measured {_machine(made)}"


def write(page: Path, results: dict[str, Any]) -> None:
    """Put the measured part into the page, between its marks."""
    before, _, rest = page.read_text(encoding="utf-8").partition(BEGIN)
    _, _, after = rest.partition(END)
    text = "\n\n".join([BEGIN, *sections(results), END])
    page.write_text(f"{before}{text}{after}", encoding="utf-8")
