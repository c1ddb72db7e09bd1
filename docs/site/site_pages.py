"""Hooks of MkDocs: the menu from the index of the documentation, and files of the repository that pages link to.

A page is the same file here and in the repository: its links lead to files of the repository, and those outside of
`docs` become files of the site under their own paths.
"""

from __future__ import annotations

import os
import pathlib
import re
from collections.abc import Iterator
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = pathlib.Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
LINK = re.compile(r"(!?\[[^\]]*\]\()([^)\s#]+)((?:#[^)\s]*)?\))")
WITHIN = re.compile(r"(\[[^\]]*\]\()#(?=\d)")
ENTRY = re.compile(r"^- \[([^\]]+)\]\(([^)]+)\)")
GROUP = re.compile(r"^(?:\*\*(.+)\*\*|## (.+))$")
# The front page of the repository beside that of the documentation.
NAMES = {"README.md": "front-page.md"}
# A number may not begin the name of an element that the theme looks for while one scrolls.
NUMBERED = re.compile(r"#(?=\d)")
SAFE = "#part-"
# The theme sets a property of these, which it has with its highlighting alone; without them its colours do not switch.
SWITCHED = '<style id="hljs-light"></style><style id="hljs-dark"></style>'
LAST = {
    "Gallery": "models/README.md",
    "Front page of the repository": "README.md",
    "Contributing": "CONTRIBUTING.md",
    "Changes": "CHANGELOG.md",
    "Security": "SECURITY.md",
    "Code of conduct": "CODE_OF_CONDUCT.md",
}


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Take the menu from the index, and anchors as the repository has them."""
    config.nav = [
        {"Overview": "README.md"},
        *_menu(),
        {"Project": [{name: NAMES.get(path, path)} for name, path in LAST.items()]},
    ]
    config.mdx_configs["toc"]["slugify"] = anchor
    return config


def anchor(heading: str, separator: str) -> str:
    """The name of a heading in links, as in the repository; `on_page_markdown` moves links to those that are not."""
    name = re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", separator)
    return NUMBERED.sub(SAFE, f"#{name}")[1:]


def on_post_page(output: str, page: Page, config: MkDocsConfig) -> str:
    """Add the elements that the theme switches."""
    return output.replace("</head>", f"{SWITCHED}</head>", 1)


def on_post_template(output_content: str, template_name: str, config: MkDocsConfig) -> str:
    """The same for a page that is made of a template alone."""
    return output_content.replace("</head>", f"{SWITCHED}</head>", 1)


def _menu() -> Iterator[dict[str, Any]]:
    groups: dict[str, list[dict[str, str]]] = {}
    heading = ""
    for line in (DOCS / "README.md").read_text(encoding="utf-8").splitlines():
        if found := GROUP.match(line):
            heading = found[1] or found[2]
        elif entry := ENTRY.match(line):
            groups.setdefault(heading, []).append({entry[1]: entry[2]})
    yield from ({name: entries} for name, entries in groups.items())


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add what the pages link to outside of `docs`, and what those link to."""
    waiting = [DOCS / file.src_uri for file in files.documentation_pages()]
    waiting += [ROOT / path for path in LAST.values()]
    seen = set(waiting)
    while waiting:
        path = waiting.pop()
        if not path.is_relative_to(DOCS):
            files.append(File.generated(config, _address(path), abs_src_path=str(path)))
        if path.suffix != ".md":
            continue
        for _, link, _ in LINK.findall(path.read_text(encoding="utf-8")):
            target = _target(path, link)
            if target is not None and target not in seen and not target.is_relative_to(DOCS):
                seen.add(target)
                waiting.append(target)
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Let links lead to where the files are on the site."""
    path = _path(page.file.src_uri)
    here = pathlib.PurePosixPath(page.file.src_uri).parent

    def moved(found: re.Match[str]) -> str:
        target = _target(path, found[2])
        if target is None:
            return found[0]
        return f"{found[1]}{os.path.relpath(_address(target), here).replace(os.sep, '/')}{NUMBERED.sub(SAFE, found[3])}"

    return LINK.sub(moved, WITHIN.sub(rf"\1{SAFE}", markdown))


def _target(page: pathlib.Path, link: str) -> pathlib.Path | None:
    """The file of the repository that a link of a page leads to; None for any other link."""
    if re.match(r"[a-z]+:|/", link):
        return None
    target = (page.parent / link).resolve()
    if target.is_dir():
        target = target / "README.md"
    return target if target.is_file() and target.is_relative_to(ROOT) else None


def _address(path: pathlib.Path) -> str:
    """The place of a file on the site."""
    name = path.relative_to(DOCS if path.is_relative_to(DOCS) else ROOT).as_posix()
    return name if path.is_relative_to(DOCS) else NAMES.get(name, name)


def _path(address: str) -> pathlib.Path:
    """The file behind a place on the site."""
    names = {new: old for old, new in NAMES.items()}
    if (DOCS / address).is_file():
        return DOCS / address
    return ROOT / names.get(address, address)
