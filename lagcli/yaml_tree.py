"""File -> tree of nodes with line and column. YAML is read event by event and never loaded into objects.

Only the plain shape of YAML is taken: mappings, sequences and scalars, one document, without tags, anchors, aliases and
duplicate keys; size, depth and number of nodes are bounded. A scalar keeps its text: what it means its reader decides.
"""

from __future__ import annotations

import bisect
import codecs
import dataclasses
import os
import pathlib
import re
import sys
from collections.abc import Iterator
from typing import Literal

import yaml

from lagcli.errors import diagnostics
from lagcli.frozen import frozen_value

MAX_BYTES = 32 * 2**20  # of a file: somebody else's may be endless
MAX_DEPTH = 16  # levels: a model needs five
MAX_NODES = 2_000_000  # entries of a file: each is an object of some hundred bytes

QUOTES = "in `{ }` and `[ ]` a text with brackets or commas needs quotes"
NEAR = 100  # characters looked at around a text that may have been cut

LINE_BREAK = re.compile("\r\n|[\n\r\x85\u2028\u2029]")
ESCAPE = re.compile(r"\\(?:x..|u.{4}|U.{8}|[^\r\n])")
BYTE_ORDER_MARK = "\ufeff"
# PyYAML has compiled it, which takes as long as a tenth of our own start; it lets byte order marks pass.
NOT_TEXT = yaml.reader.Reader.NON_PRINTABLE

_Loader: type = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


@frozen_value
class Text:
    """The whole text of a file with its name, able to locate an offset.

    `lines` are without their breaks; all locations of one line share its text, however long it is.
    """

    path: str
    content: str
    line_starts: tuple[int, ...]
    lines: tuple[str, ...]

    def locate(self, start: int, end: int | None = None) -> diagnostics.Location:
        """Line and column of characters `start` to `end` (offsets in the text)."""
        start = min(start, len(self.content))
        row = bisect.bisect_right(self.line_starts, start) - 1
        begin, line = self.line_starts[row], self.lines[row]
        length = max(1, min((end or start + 1), begin + len(line)) - start)
        return diagnostics.Location(self.path, row + 1, start - begin + 1, length, line)


@dataclasses.dataclass(frozen=True, slots=True)
class YamlNode:
    """A piece of the document: offsets `start` to `end` of the text it came from."""

    text: Text = dataclasses.field(repr=False)
    start: int
    end: int

    @property
    def location(self) -> diagnostics.Location:
        return self.text.locate(self.start, self.end)


Style = Literal["plain", "'", '"', "|", ">"]
_STYLES: dict[str | None, Style] = {"'": "'", '"': '"', "|": "|", ">": ">"}


@dataclasses.dataclass(frozen=True, slots=True)
class Scalar(YamlNode):
    """A text, with escapes and folding resolved; `style` is the sign it was written with."""

    value: str
    style: Style = "plain"

    @property
    def is_torn(self) -> bool:
        """True if this looks like part of an unquoted text that a comma in `{ }` or `[ ]` has cut in pieces."""
        if self.style != "plain" or self.value.count("(") == self.value.count(")"):
            return False
        near = self.text.content[max(0, self.start - NEAR) : self.start].rstrip()
        return near.endswith(",") or self.text.content[self.end : self.end + NEAR].lstrip().startswith(",")

    def locate(self, start: int, end: int) -> diagnostics.Location:
        """Location of characters `start` to `end` of `value` in the file."""
        if not self.value:
            return self.location
        beyond = start >= len(self.value)
        start = min(start, len(self.value) - 1)
        last = min(max(end - 1, start), len(self.value) - 1)
        origins = self._origins(last + 1)
        first = origins[start] + beyond
        return self.text.locate(first, max(origins[last], first) + 1)

    def _origins(self, count: int) -> range | list[int]:
        """Offsets in the file of the first `count` characters of `value`.

        Where the scalar is written plainly the characters follow one another. Folding, block indents and
        escapes are walked over by looking for each character of the value in turn.
        """
        raw = self.text.content
        begin = self.start + (self.style in ("'", '"'))
        if self.style in ("|", ">"):
            # The line of the sign holds no text of the scalar.
            begin = min(self.end, self.text.line_starts[self.text.locate(self.start).line])
        if raw.startswith(self.value, begin):
            return range(begin, begin + count)
        found: list[int] = []
        at = begin
        for character in self.value[:count]:
            if self.style == '"' and (escape := ESCAPE.match(raw, at)):
                found.append(at)
                at = escape.end()
                continue
            if not character.isspace():
                at = max(raw.find(character, at, self.end), at)
            found.append(min(at, self.end))
            at += 1
        return found


@dataclasses.dataclass(frozen=True, slots=True)
class Sequence(YamlNode):
    """A list of nodes."""

    items: tuple[Scalar | Sequence | Mapping, ...]


@dataclasses.dataclass(frozen=True, slots=True)
class Mapping(YamlNode):
    """Keys and values in the order of the file; a duplicate key has been reported and left out."""

    entries: tuple[tuple[Scalar, Scalar | Sequence | Mapping], ...]

    def get(self, key: str) -> AnyNode | None:
        return next((value for name, value in self.entries if name.value == key), None)

    def key(self, key: str) -> Scalar | None:
        """The key node itself, for locating."""
        return next((name for name, _ in self.entries if name.value == key), None)

    def __iter__(self) -> Iterator[tuple[Scalar, AnyNode]]:
        return iter(self.entries)


AnyNode = Scalar | Sequence | Mapping


def is_empty(node: AnyNode) -> bool:
    """True if nothing was written: `key:` with no value, `{}` or `[]`."""
    match node:
        case Scalar():
            return node.value == "" and node.style == "plain"
        case Sequence():
            return not node.items
        case Mapping():
            return not node.entries


def as_text(content: str, path: str) -> Text:
    """A text of which single stretches are to be located (command-line values, expressions in tests)."""
    starts, lines = [0], []
    for found in LINE_BREAK.finditer(content):
        lines.append(content[starts[-1] : found.start()])
        starts.append(found.end())
    return Text(path, content, tuple(starts), (*lines, content[starts[-1] :]))


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
        at = as_text("", name).locate(0)
        raise diagnostics.error("not-a-file", "this is a directory, not a model file", at)
    with open(name, "rb") as file:
        return file.read(MAX_BYTES + 1)


def parse(data: bytes | str, path: str) -> Mapping:
    """The document as a tree. Raises `ModelError` with everything that is wrong with its outer shape."""
    text = as_text(_decode(data, path), path)
    found = diagnostics.Collector()
    try:
        root = _build(text, found)
    except yaml.YAMLError as error:
        raise _yaml_error(error, text) from None
    hint = "a model begins with the line `lagcli: 1`"
    if root is None or (isinstance(root, Scalar) and is_empty(root)):
        raise diagnostics.error("empty-model", "the file holds no model", text.locate(0), hint)
    if not isinstance(root, Mapping):
        raise diagnostics.error("not-a-mapping", "a model file is a mapping of sections", root.location, hint)
    found.raise_errors()
    return root


def _decode(data: bytes | str, path: str) -> str:
    if len(data) > MAX_BYTES:
        message = f"the file is larger than {MAX_BYTES // 2**20} MiB"
        raise diagnostics.error("too-large", message, as_text("", path).locate(0))
    if isinstance(data, str):
        content = data
    else:
        if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
            raise _not_text("the file is UTF-16 text, not UTF-8", "", path)
        try:
            content = data.decode("utf-8")
        except UnicodeDecodeError as error:
            message = f"the file is not UTF-8 text (byte {error.start})"
            raise _not_text(message, data[: error.start].decode("utf-8"), path) from None
    content = content.removeprefix(BYTE_ORDER_MARK)
    found = (bad.start() if (bad := NOT_TEXT.search(content)) else -1, content.find(BYTE_ORDER_MARK))
    if (at := min((index for index in found if index >= 0), default=None)) is not None:
        message = f"the file is not text: it holds the character {content[at]!a}"
        raise _not_text(message, content[:at], path)
    return content


def _not_text(message: str, good: str, path: str) -> diagnostics.ModelError:
    """The refusal of a file that is text only as far as `good`."""
    at = as_text(good.removeprefix(BYTE_ORDER_MARK), path)
    location = dataclasses.replace(at.locate(len(at.content)), source_line="")
    return diagnostics.error("not-text", message, location, "save the model as plain text in UTF-8")


def _yaml_error(error: yaml.YAMLError, text: Text) -> diagnostics.ModelError:
    mark = getattr(error, "problem_mark", None)
    begun = getattr(error, "context_mark", None)
    problem = getattr(error, "problem", None) or "this is not YAML"
    context = getattr(error, "context", None) or ""
    offset: int = mark.index if mark is not None else 0
    if begun is not None and not text.content[offset:].strip():
        offset = begun.index  # what is never closed is shown where it begins
    message = f"not YAML: {problem}" + (f" {context}" if context else "")
    location = text.locate(offset)
    if begun is not None and begun.line + 1 != location.line:
        message += f" that begins on line {begun.line + 1}"
    before = location.source_line[: location.column - 1].rstrip()
    hint = ""
    if "mapping values" in problem or "expected ':'" in problem or "expected key" in problem:
        hint = _missing_colon(text, location.line - 1)
    if not hint and before.endswith("]") and re.search(r":\s+\[", before):
        hint = "an equation that begins with `[` needs quotes"
    hint = hint or _yaml_hint(problem, context, text.content[offset : offset + 1])
    return diagnostics.error("yaml-syntax", message, location, hint)


def _missing_colon(text: Text, line: int) -> str:
    """The fault of the last line up to a 1-based one that holds anything, where it is a colon, or nothing."""
    while line and not text.lines[line - 1].partition("#")[0].strip():
        line -= 1
    written = text.lines[line - 1].partition("#")[0].strip() if line else ""
    if found := re.fullmatch(r"([A-Za-z_]\w*):([^\s:][^:]*)", written):
        return f"line {line}: a colon needs a space after it: `{found[1]}: {found[2]}`"
    if found := re.fullmatch(r"([A-Za-z_]\w*)(\s+[^:]+)?", written):
        return f"line {line} has no colon: `{found[1]}:{' ' + found[2].strip() if found[2] else ''}`"
    return ""


def _yaml_hint(problem: str, context: str, sign: str) -> str:
    if "unexpected ':'" in problem:
        return "a colon needs a space after it"
    if "escape" in problem:
        return r"within double quotes `\` begins an escape, as in `\n`; write `\\`, or take single quotes"
    if "quoted" in context:
        return "a quote is never closed"
    if "flow" in context:
        return f"a bracket is not closed, or a quote is missing: {QUOTES}"
    if sign == "\t":
        return "indents are spaces, never tabs"
    if "cannot start any token" in problem:
        return f"a text that begins with `{sign}` needs quotes"
    return "a text that holds `: ` or ` #` needs quotes, and entries of one level have one indent"


def _span(event: yaml.Event) -> tuple[int, int]:
    """Offsets of an event; a parser of text always marks them."""
    start, end = event.start_mark, event.end_mark
    return (start.index, end.index) if start is not None and end is not None else (0, 0)


@dataclasses.dataclass(slots=True)
class _Open:
    """A collection whose end has not come yet."""

    start: int
    is_mapping: bool
    items: list[AnyNode] = dataclasses.field(default_factory=list)


def _build(text: Text, found: diagnostics.Collector) -> AnyNode | None:
    """The root node from the parser's events, with a stack of its own; None for a stream without a document."""
    stack: list[_Open] = []
    root: AnyNode | None = None
    documents = count = 0
    for event in yaml.parse(text.content, Loader=_Loader):
        node: AnyNode
        match event:
            case yaml.DocumentStartEvent():
                documents += 1
                if documents > 1:
                    message = "a model file holds one YAML document"
                    raise diagnostics.error("several-documents", message, text.locate(*_span(event)))
                continue
            case yaml.AliasEvent():
                message = "YAML aliases (`*name`) are not allowed in a model file"
                hint = "a text that begins with `*` needs quotes"
                raise diagnostics.error("yaml-alias", message, text.locate(*_span(event)), hint)
            case yaml.NodeEvent():
                count += 1
                _require_plain(event, text, count, len(stack))
                start, end = _span(event)
                if not isinstance(event, yaml.ScalarEvent):
                    stack.append(_Open(start, isinstance(event, yaml.MappingStartEvent)))
                    continue
                node = Scalar(text, start, end, event.value, _STYLES.get(event.style, "plain"))
            case yaml.MappingEndEvent() | yaml.SequenceEndEvent():
                ended, (_, end) = stack.pop(), _span(event)
                if ended.is_mapping:
                    node = Mapping(text, ended.start, end, _entries(ended.items, found))
                else:
                    node = Sequence(text, ended.start, end, tuple(ended.items))
            case _:
                continue
        if stack:
            stack[-1].items.append(node)
        else:
            root = node
    return root


def _require_plain(event: yaml.NodeEvent, text: Text, count: int, depth: int) -> None:
    """Raise `ModelError` for an anchor, a tag, one node too many, or one too deep."""
    # Every event of this kind has a tag; the type stubs know it of some only.
    tag: str | None = getattr(event, "tag", None)
    is_deep = depth >= MAX_DEPTH and not isinstance(event, yaml.ScalarEvent)
    if count <= MAX_NODES and event.anchor is None and tag is None and not is_deep:
        return
    at = text.locate(*_span(event))
    if count > MAX_NODES:
        raise diagnostics.error("too-large", f"the file holds more than {MAX_NODES} entries", at)
    if event.anchor is not None:
        message = "YAML anchors (`&name`) are not allowed in a model file"
        raise diagnostics.error("yaml-alias", message, at, "a text that begins with `&` needs quotes")
    if tag is not None:
        message = f"YAML tags (`{tag}`) are not allowed in a model file"
        raise diagnostics.error("yaml-tag", message, at, "a text that begins with `!` needs quotes")
    raise diagnostics.error("too-deep", f"brackets or indents nest deeper than {MAX_DEPTH} levels", at)


def _entries(items: list[AnyNode], found: diagnostics.Collector) -> tuple[tuple[Scalar, AnyNode], ...]:
    entries: dict[str, tuple[Scalar, AnyNode]] = {}
    for key, value in zip(items[::2], items[1::2], strict=True):
        if not isinstance(key, Scalar):
            found.add(diagnostics.Diagnostic("bad-key", "a key must be a plain text", key.location))
        elif key.value in entries:
            first = entries[key.value][0].location.line
            message = f"the key `{key.value}` occurs twice (first on line {first})"
            found.add(diagnostics.Diagnostic("duplicate-key", message, key.location))
        else:
            # What is not there is shown at its key, wherever the parser takes its location to be.
            if isinstance(value, Scalar) and is_empty(value):
                value = dataclasses.replace(key, value="", style="plain")
            entries[key.value] = key, value
    return tuple(entries.values())
