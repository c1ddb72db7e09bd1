"""File -> tree of nodes with line and column. YAML is read event by event and never loaded into objects.

Only the plain shape of YAML is taken: mappings, sequences and scalars, one document. Tags, anchors and
aliases are refused, duplicate keys too, and size, depth and number of nodes are bounded, so that a stranger's
file is read in time proportional to its length. A scalar keeps its text: what it means is decided by whoever
reads it, never by YAML's own typing.
"""

from __future__ import annotations

import bisect
import dataclasses
import os
import pathlib
import re
import sys
from collections.abc import Iterator

import yaml

from lagcli import diagnostics

MAX_BYTES = 32 * 2**20
MAX_DEPTH = 16
MAX_NODES = 2_000_000

LINE_BREAK = re.compile("\r\n|[\n\r\x85\u2028\u2029]")

_Loader: type = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


@dataclasses.dataclass(frozen=True, slots=True)
class Text:
    """The whole text of a file with its name, able to locate an offset."""

    path: str
    content: str
    line_starts: tuple[int, ...]

    def locate(self, start: int, end: int | None = None) -> diagnostics.Location:
        """Line and column of characters `start` to `end` (offsets in the text)."""
        start = min(start, len(self.content))
        row = bisect.bisect_right(self.line_starts, start) - 1
        begin = self.line_starts[row]
        after = self.line_starts[row + 1] if row + 1 < len(self.line_starts) else len(self.content)
        line = self.content[begin:after].rstrip("\r\n\x85\u2028\u2029")
        length = max(1, min((end or start + 1), begin + len(line)) - start)
        return diagnostics.Location(self.path, row + 1, start - begin + 1, length, line)


@dataclasses.dataclass(frozen=True, slots=True)
class Node:
    """A piece of the document: offsets `start` to `end` of the text it came from."""

    text: Text
    start: int
    end: int

    @property
    def location(self) -> diagnostics.Location:
        """Where the node stands."""
        return self.text.locate(self.start, self.end)


@dataclasses.dataclass(frozen=True, slots=True)
class Scalar(Node):
    """A text, as written (escapes and folding resolved)."""

    value: str
    quoted: bool = False

    def locate(self, start: int, end: int) -> diagnostics.Location:
        """Location of characters `start` to `end` of `value` in the file."""
        origin = self._origins(max(start, end - 1) + 1)
        if not origin:
            return self.location
        first = origin[min(start, len(origin) - 1)] + (1 if start >= len(origin) else 0)
        last = origin[min(max(end - 1, start), len(origin) - 1)]
        return self.text.locate(first, max(last, first) + 1)

    def _origins(self, count: int) -> list[int]:
        """Offsets in the file of the first `count` characters of `value`.

        Where the scalar is written plainly the characters follow one another. Folding, block indents and
        escapes are walked over by looking for each character of the value in turn.
        """
        raw, value = self.text.content, self.value
        begin = self.start + (1 if self.quoted else 0)
        if raw.startswith(value, begin):
            return list(range(begin, begin + min(count, len(value))))
        found: list[int] = []
        at = begin
        for character in value[:count]:
            if character.isspace():
                while at < self.end and not raw[at].isspace():
                    at += 1
            else:
                next_at = raw.find(character, at, self.end)
                at = next_at if next_at >= 0 else at
            found.append(min(at, self.end))
            at += 1
        return found


@dataclasses.dataclass(frozen=True, slots=True)
class Sequence(Node):
    """A list of nodes."""

    items: tuple[Scalar | Sequence | Mapping, ...]


@dataclasses.dataclass(frozen=True, slots=True)
class Mapping(Node):
    """Keys and values in the order of the file; a duplicate key has been reported and left out."""

    entries: tuple[tuple[Scalar, Scalar | Sequence | Mapping], ...]

    def get(self, key: str) -> AnyNode | None:
        """The value under `key`, or None."""
        return next((value for name, value in self.entries if name.value == key), None)

    def key(self, key: str) -> Scalar | None:
        """The key node itself, for locating."""
        return next((name for name, _ in self.entries if name.value == key), None)

    def __iter__(self) -> Iterator[tuple[Scalar, AnyNode]]:
        return iter(self.entries)


AnyNode = Scalar | Sequence | Mapping


def is_empty(node: AnyNode) -> bool:
    """Whether nothing was written: `key:` with no value, `{}` or `[]`."""
    match node:
        case Scalar():
            return node.value == "" and not node.quoted
        case Sequence():
            return not node.items
        case Mapping():
            return not node.entries


def as_text(content: str, path: str) -> Text:
    """A text of which single stretches are to be located (command-line values, expressions in tests)."""
    return Text(path, content, (0, *(match.end() for match in LINE_BREAK.finditer(content))))


def scalar(content: str, path: str) -> Scalar:
    """A scalar that stands in no file, for example the value of a command-line option."""
    return Scalar(as_text(content, path), 0, len(content), content)


def read(path: str | os.PathLike[str]) -> bytes:
    """The bytes of a model file; `-` is standard input.

    Raises `ModelError` for a directory and for a file that is too large, `FileNotFoundError` and other
    `OSError` as they come.
    """
    name = os.fspath(path)
    if name == "-":
        return sys.stdin.buffer.read(MAX_BYTES + 1)
    if pathlib.Path(name).is_dir():
        raise _refused("not-a-file", "this is a directory, not a model file", as_text("", name))
    with open(name, "rb") as file:
        return file.read(MAX_BYTES + 1)


def parse(data: bytes | str, path: str) -> Mapping:
    """The document as a tree. Raises `ModelError` with everything that is wrong with its outer shape."""
    text = as_text(_decode(data, path), path)
    found = diagnostics.Collector()
    try:
        root = _Builder(text, found).build()
    except yaml.YAMLError as error:
        raise diagnostics.ModelError([_yaml_error(error, text)]) from None
    if root is None or (isinstance(root, Scalar) and is_empty(root)):
        raise _refused("empty-model", "the file holds no model", text, "a model begins with the line `lagcli: 1`")
    if not isinstance(root, Mapping):
        raise diagnostics.ModelError(
            [
                diagnostics.Diagnostic(
                    "not-a-mapping", "a model file is a mapping of sections", root.location,
                    "it begins with the line `lagcli: 1`",
                )
            ]
        )  # fmt: skip
    found.raise_errors()
    return root


def _refused(code: str, message: str, text: Text, hint: str = "") -> diagnostics.ModelError:
    return diagnostics.ModelError([diagnostics.Diagnostic(code, message, text.locate(0), hint)])


def _decode(data: bytes | str, path: str) -> str:
    nothing = as_text("", path)
    if len(data) > MAX_BYTES:
        raise _refused("too-large", f"the file is larger than {MAX_BYTES // 2**20} MiB", nothing)
    if isinstance(data, str):
        content = data
    else:
        try:
            content = data.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            good = as_text(data[: error.start].decode("utf-8-sig"), path)
            at = good.locate(len(good.content))
            message = f"the file is not UTF-8 text (byte {error.start})"
            raise diagnostics.ModelError(
                [diagnostics.Diagnostic("not-text", message, dataclasses.replace(at, source_line=""))]
            ) from None
    bad = next((i for i, c in enumerate(content) if c < " " and c not in "\t\n\r"), None) if (
        "\0" in content or not content.isprintable()
    ) else None  # fmt: skip
    if bad is not None:
        at = as_text(content, path).locate(bad)
        message = f"the file is not text: it holds the control character {content[bad]!r}"
        raise diagnostics.ModelError(
            [diagnostics.Diagnostic("not-text", message, dataclasses.replace(at, source_line=""))]
        )
    return content


def _yaml_error(error: yaml.YAMLError, text: Text) -> diagnostics.Diagnostic:
    mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
    problem = getattr(error, "problem", None) or getattr(error, "reason", None) or "this is not YAML"
    context = getattr(error, "context", None)
    offset = mark.index if mark is not None else getattr(error, "position", 0)
    message = f"not YAML: {problem}" + (f" {context}" if context else "")
    location = text.locate(offset)
    hint = ""
    if any(sign in location.source_line for sign in "{["):
        hint = "in `{ }` and `[ ]` a text with brackets or commas needs quotes: \"a[1], b\""
    elif ": " in location.source_line or "\t" in location.source_line:
        hint = "a text that holds `: ` or ` #` needs quotes, and indents are spaces, never tabs"
    return diagnostics.Diagnostic("yaml-syntax", message, location, hint)


@dataclasses.dataclass(slots=True)
class _Open:
    """A collection whose end has not come yet."""

    start: int
    is_mapping: bool
    items: list[AnyNode] = dataclasses.field(default_factory=list)


class _Builder:
    """Builds the tree from the parser's events, with its own stack: no recursion, no object construction."""

    def __init__(self, text: Text, found: diagnostics.Collector) -> None:
        self._text = text
        self._found = found
        self._stack: list[_Open] = []
        self._root: AnyNode | None = None
        self._count = 0

    def build(self) -> AnyNode | None:
        """The root node, or None for a stream without a document."""
        documents = 0
        for event in yaml.parse(self._text.content, Loader=_Loader):
            match event:
                case yaml.DocumentStartEvent():
                    documents += 1
                    if documents > 1:
                        self._refuse(event, "several-documents", "a model file holds one YAML document")
                case yaml.AliasEvent():
                    self._refuse(event, "yaml-alias", "YAML aliases (`*name`) are not allowed in a model file")
                case yaml.NodeEvent():
                    self._node(event)
                case yaml.MappingEndEvent() | yaml.SequenceEndEvent():
                    self._close(event)
        return self._root

    def _refuse(self, event: yaml.Event, code: str, message: str, hint: str = "") -> None:
        location = self._text.locate(event.start_mark.index, event.end_mark.index)
        raise diagnostics.ModelError([diagnostics.Diagnostic(code, message, location, hint)])

    def _node(self, event: yaml.NodeEvent) -> None:
        self._count += 1
        if self._count > MAX_NODES:
            self._refuse(event, "too-large", f"the file holds more than {MAX_NODES} entries")
        if event.anchor is not None:
            self._refuse(event, "yaml-alias", "YAML anchors (`&name`) are not allowed in a model file")
        if event.tag is not None:
            self._refuse(
                event, "yaml-tag", f"YAML tags (`{event.tag}`) are not allowed in a model file",
                "a text that begins with `!` needs quotes",
            )  # fmt: skip
        start, end = event.start_mark.index, event.end_mark.index
        if isinstance(event, yaml.ScalarEvent):
            quoted = event.style in ("'", '"')
            self._add(Scalar(self._text, start, end, event.value, quoted))
            return
        if len(self._stack) >= MAX_DEPTH:
            self._refuse(event, "too-deep", f"brackets or indents nest deeper than {MAX_DEPTH} levels")
        self._stack.append(_Open(start, isinstance(event, yaml.MappingStartEvent)))

    def _close(self, event: yaml.Event) -> None:
        ended = self._stack.pop()
        end = event.end_mark.index
        if ended.is_mapping:
            self._add(Mapping(self._text, ended.start, end, self._entries(ended.items)))
        else:
            self._add(Sequence(self._text, ended.start, end, tuple(ended.items)))

    def _add(self, node: AnyNode) -> None:
        if self._stack:
            self._stack[-1].items.append(node)
        else:
            self._root = node

    def _entries(self, items: list[AnyNode]) -> tuple[tuple[Scalar, AnyNode], ...]:
        entries: dict[str, tuple[Scalar, AnyNode]] = {}
        for key, value in zip(items[::2], items[1::2], strict=True):
            if not isinstance(key, Scalar):
                self._report("bad-key", "a key must be a plain text", key)
            elif key.value in entries:
                first = entries[key.value][0].location.line
                self._report("duplicate-key", f"the key `{key.value}` stands twice (first on line {first})", key)
            else:
                entries[key.value] = (key, value)
        return tuple(entries.values())

    def _report(self, code: str, message: str, node: AnyNode) -> None:
        self._found.add(diagnostics.Diagnostic(code, message, node.location))
