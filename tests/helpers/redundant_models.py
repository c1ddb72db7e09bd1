"""Models of the gallery without their redundant rows."""

import copy
import json
import pathlib
import re

import yaml

HERE = pathlib.Path(__file__).parents[1]
MODELS = HERE.parent / "models"
GALLERY = json.loads((HERE / "gallery.json").read_text(encoding="utf-8"))
REDUNDANT = [name for name, entry in GALLERY.items() if "redundant" in entry]


def twice(name: str) -> tuple[str, str]:
    """The file without outputs, and the same with each constraint declared a second time, three times as large."""
    document = yaml.safe_load((MODELS / name).read_text(encoding="utf-8"))
    document.pop("outputs", None)
    once = yaml.safe_dump(document, sort_keys=False)
    for section in ("holonomic", "differential", "inequality"):
        law = "condition" if section == "inequality" else "equation"
        for key, value in list((document.get(section) or {}).items()):
            entry = {law: value} if isinstance(value, str) else copy.deepcopy(value)
            left, sign, right = re.split("([<>]?=)", entry[law])
            entry[law] = f"3*({left}) {sign} 3*({right})"
            base, bracket, indices = key.partition("[")
            document[section][f"{base}_twin{bracket}{indices}"] = entry
    return once, yaml.safe_dump(document, sort_keys=False)


def without(name: str) -> str:
    """The file without its redundant rows (a member of a family is kept out by `if`) and without outputs."""
    text = (MODELS / name).read_text(encoding="utf-8")
    text = re.sub(r"^outputs:\n(?: .*\n)+", "", text, flags=re.MULTILINE)
    for row in GALLERY[name]["redundant"]:
        base, *members = re.findall(r"[^][]+", row)
        (line,) = re.findall(rf"^  {base}\b.*\n", text, re.MULTILINE)
        indices = re.findall(r"(\w+) = \d", line)
        others = " or ".join(f"{i} != {member}" for i, member in zip(indices, members, strict=True))
        text = text.replace(line, line.replace("equation:", f'if: "{others}", equation:') if members else "")
    return text
