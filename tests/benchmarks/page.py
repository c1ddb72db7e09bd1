"""The results as Markdown and as a figure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from . import environment

BEGIN, END = "<!-- measured: begin -->", "<!-- measured: end -->"
NAMES = {"lagcli": "lagcli", **{peer.key: peer.name for peer in environment.ALL}}
PARTS = ("steps", "build", "contest", "whole")


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
    head = ["links", "rod as", "yardstick, a step", "lagcli, a step", "ratio", "rows", "run, a step"]
    head += ["ratio", "ratio, ends only", "step, a link"]
    rows = [
        [
            _links(line["links"]),
            "`distance`" if line["rod"] == "distance" else "`dot`",
            seconds(line["yardstick_step"]),
            seconds(line["step"]),
            _ratio(line["step_ratio"], line["step_target"]),
            str(line["rows"]),
            seconds(line["run"]),
            _ratio(line["run_ratio"], line["run_target"]),
            f"{line['bare_ratio']:.2f}",
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


def _answered(results: dict[str, Any]) -> list[str]:
    return [key for key in NAMES if any(key in case["answers"] for case in results["contest"])]


def contest(results: dict[str, Any]) -> str:
    """lagcli beside other programs: the time of the solution, the error, the setting."""
    head = ["motion", "program", "solution", "times lagcli", "error", "build", "setting"]
    rows = []
    for case in results["contest"]:
        own = case["answers"]["lagcli"].get("solve_seconds")
        for key in _answered(results):
            if key in case["answers"]:
                name = f"{case['case']}, {case['duration']:g} s" if key == "lagcli" else ""
                rows.append([name, NAMES[key], *_answer(case["answers"][key], own)])
    return _table(head, rows)


def _answer(answer: dict[str, Any], own: float) -> list[str]:
    if "solve_seconds" not in answer:
        return [answer["reason"], *["-"] * 4]
    error = "-" if answer["error"] is None else f"{answer['error']:.0e}"
    time = answer["solve_seconds"]
    said = f"{answer['setting']}" + ("" if answer["reached"] else f"; wanted error {answer['reason']}")
    sign = "" if answer["reached"] else "> "
    times = f"{sign}{time / own:.3g}"
    return [sign + seconds(time), times, error, seconds(answer["build_seconds"]), said]


def whole(results: dict[str, Any]) -> str:
    """Whole processes."""
    found = results["whole"]
    own, limit = found["seconds"]["lagcli"], found["limit"]
    rows = [
        [NAMES[key], f"> {seconds(limit)}", f"> {limit / own:.3g}"]
        if time is None
        else [NAMES[key], seconds(time), f"{time / own:.3g}"]
        for key, time in found["seconds"].items()
    ]
    return _table(["program", "process", "times lagcli"], rows)


MAKERS = {"steps": steps, "build": build, "contest": contest, "whole": whole}
TITLES = {
    "steps": "Beside the yardstick",
    "build": "Large models",
    "contest": "Beside other programs",
    "whole": "A whole process",
}


def _machine(made: dict[str, Any]) -> str:
    own = ", ".join(f"{name} {version}" for name, version in made["versions"].items())
    peers = ", ".join(f"{name} {version}" for name, version in made["peers"].items())
    system = f"{made['processor']}, {made['cores']} cores, {made['system']}"
    text = f"{made['date']}; {system}; Python {made['python']}, {own}"
    return text + (f"; peers: {peers}" if peers else "") + f"; `{made['command']}`."


def sections(results: dict[str, Any]) -> Iterator[str]:
    """The measured part of the page."""
    for part in PARTS:
        if results.get(part):
            yield f"### {TITLES[part]}"
            yield MAKERS[part](results)
            yield f"Measured {_machine(results['machines'][part])}"


def write(page: Path, results: dict[str, Any]) -> None:
    """Put the measured part into the page, between its marks."""
    before, _, rest = page.read_text(encoding="utf-8").partition(BEGIN)
    _, _, after = rest.partition(END)
    text = "\n\n".join([BEGIN, *sections(results), END])
    page.write_text(f"{before}{text}{after}", encoding="utf-8")
