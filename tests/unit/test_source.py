"""The outer shape of a file: what is read, what is refused, and where things stand in it."""

from __future__ import annotations

import pathlib
import unicodedata

import pytest

from lagcli import yaml_tree
from lagcli.errors import diagnostics
from tests.helpers.spent import at_most_calls

SMALL = "lagcli: 1\nparticles:\n  a: {mass: 1, position: [1, 0, 0]}\n"


def errors_of(data: bytes | str) -> tuple[diagnostics.Diagnostic, ...]:
    with pytest.raises(diagnostics.ModelError) as caught:
        yaml_tree.parse(data, "model.yaml")
    return caught.value.diagnostics


def the_error(data: bytes | str) -> diagnostics.Diagnostic:
    (only,) = errors_of(data)
    return only


def place(found: diagnostics.Diagnostic) -> tuple[str, int, int]:
    return found.code, found.location.line, found.location.column


def only_scalar(text: str, key: str = "k") -> yaml_tree.Scalar:
    node = yaml_tree.parse(text, "model.yaml").get(key)
    assert isinstance(node, yaml_tree.Scalar)
    return node


def shown(scalar: yaml_tree.Scalar, part: str) -> tuple[int, int, str]:
    """Line, column and text under the carets of a part of a scalar's value."""
    start = scalar.value.index(part)
    at = scalar.locate(start, start + len(part))
    return at.line, at.column, at.source_line[at.column - 1 : at.column - 1 + at.length]


def test_scalars_keep_their_text() -> None:
    root = yaml_tree.parse("a: 1e3\nb: no\nc: 0x10\nd: ~\ne: 2024-01-01\nf: 'yes'\n", "model.yaml")
    values = {key.value: node.value for key, node in root if isinstance(node, yaml_tree.Scalar)}
    assert values == {"a": "1e3", "b": "no", "c": "0x10", "d": "~", "e": "2024-01-01", "f": "yes"}


def test_mappings_keep_their_order() -> None:
    root = yaml_tree.parse("z: 1\na: 2\nm: 3\n", "model.yaml")
    assert [key.value for key, _ in root] == ["z", "a", "m"]


@pytest.mark.parametrize(
    "data", [b"\xef\xbb\xbf" + SMALL.encode(), "\ufeff" + SMALL, SMALL.replace("\n", "\r\n")]
)
def test_a_mark_at_the_start_and_line_ends_of_windows_change_nothing(data: bytes | str) -> None:
    root = yaml_tree.parse(data, "model.yaml")
    key = root.key("particles")
    assert key is not None
    assert (key.location.line, key.location.column, key.location.source_line) == (2, 1, "particles:")


@pytest.mark.parametrize(
    "data", [b"", b"   \n\n", b"# a comment\n", b"\xef\xbb\xbf", b"---\n", b"---\n...\n"]
)
def test_a_file_without_content_is_said_to_be_empty(data: bytes) -> None:
    found = the_error(data)
    assert found.code == "empty-model"
    assert "lagcli: 1" in found.hint


@pytest.mark.parametrize("data", ["- a\n- b\n", "just a text", "[1, 2]"])
def test_a_document_that_is_no_mapping_is_refused(data: str) -> None:
    assert place(the_error(data)) == ("not-a-mapping", 1, 1)


@pytest.mark.parametrize(
    ("data", "line", "column"),
    [
        (b"\x7fELF\x02\x01\x01\x00", 1, 1),
        (b"lagcli: 1\ntitle: a\x00b\n", 2, 9),
        (b"lagcli: 1\ntitle: caf\xe9\n", 2, 11),
        (b"\xef\xbb\xbflagcli: 1\ntitle: \xc3\xa9\xe9\n", 2, 9),
        (b"\x89PNG\r\n\x1a\n", 1, 1),
        (b"\x1f\x8b\x08\x00abc", 1, 2),
        ("lagcli: 1\n".encode("utf-16"), 1, 1),
        ("lagcli: 1\n".encode("utf-16-be"), 1, 1),
        ("title: \u2713\u2713\x1b[31m".encode(), 1, 10),
        ("title: \ud800", 1, 8),
        ("title: a\ufeffb", 1, 9),
    ],
)
def test_what_is_no_text_is_refused_at_its_first_bad_character(
    data: bytes | str, line: int, column: int
) -> None:
    found = the_error(data)
    assert place(found) == ("not-text", line, column)
    assert "\x1b" not in found.render()


def test_utf_16_is_called_by_its_name() -> None:
    assert "UTF-16" in the_error("lagcli: 1\n".encode("utf-16")).message


def test_a_directory_is_refused(tmp_path: pathlib.Path) -> None:
    with pytest.raises(diagnostics.ModelError, match="not-a-file"):
        yaml_tree.read(tmp_path)


def test_a_missing_file_stays_an_error_of_the_system(tmp_path: pathlib.Path) -> None:
    with pytest.raises(FileNotFoundError):
        yaml_tree.read(tmp_path / "none.yaml")


def test_a_file_beyond_the_bound_is_refused_unread() -> None:
    assert the_error(b"a" * (yaml_tree.MAX_BYTES + 1)).code == "too-large"


@pytest.mark.parametrize(
    ("text", "code", "line", "column"),
    [
        ("a: &x 1\nb: *x\n", "yaml-alias", 1, 4),
        ("a: 1\nb: *x\n", "yaml-alias", 2, 4),
        ("a: 1\nb: &x {c: 1}\n", "yaml-alias", 2, 4),
        ("a: !!float 1\n", "yaml-tag", 1, 4),
        ("a: !!python/object/apply:os.system ['id']\n", "yaml-tag", 1, 4),
        ("a: ! b\n", "yaml-tag", 1, 4),
        ("--- !!map\na: 1\n", "yaml-tag", 1, 5),
        ("a: 1\n---\nb: 2\n", "several-documents", 2, 1),
        ("a: 1\n[x]: 2\n", "bad-key", 2, 1),
        ("a: 1\n? {x: 1}\n: 2\n", "bad-key", 2, 3),
    ],
)
def test_what_yaml_has_and_a_model_has_not(text: str, code: str, line: int, column: int) -> None:
    assert place(errors_of(text)[0]) == (code, line, column)


def test_an_alias_bomb_ends_at_its_first_anchor() -> None:
    bomb = "a: &a [x, x]\n" + "".join(
        f"{c}: &{c} [{', '.join([f'*{p}'] * 9)}]\n" for p, c in zip("abcdefgh", "bcdefghi", strict=True)
    )
    assert place(the_error(bomb)) == ("yaml-alias", 1, 4)


def test_every_duplicate_key_is_reported_with_the_line_of_the_first() -> None:
    found = errors_of("a: 1\nb: {c: 1, c: 2}\na: 3\n'a': 4\n")
    assert [place(d) for d in found] == [
        ("duplicate-key", 2, 11),
        ("duplicate-key", 3, 1),
        ("duplicate-key", 4, 1),
    ]
    assert "line 1" in found[1].message


@pytest.mark.parametrize("sign", ["[", "{", "- ", "{a: ", "? "])
def test_deep_nesting_is_refused_at_once(sign: str) -> None:
    with at_most_calls(2_000_000):
        found = the_error(sign * (100_000 // len(sign)))
        assert found.code in ("too-deep", "yaml-syntax")
        assert found.location.line == 1


def test_a_scalar_of_ten_megabytes_is_read_in_a_moment() -> None:
    scalar = only_scalar("k: " + "1+" * 5_000_000 + "1\n")
    assert len(scalar.value) == 10_000_001
    assert len(diagnostics.Diagnostic("c", "m", scalar.location).render()) < 300
    with at_most_calls(15_000_000):
        only_scalar("k: " + "1+" * 500_000 + "1\n")


@pytest.mark.parametrize(
    ("text", "line", "word"),
    [
        ("a: {to: b, force: [x[1], 0, 0]}\n", 1, "quotes"),
        ("a: {b: [1, 2, 3]*2}\n", 1, "quotes"),
        ("a: b: c\n", 1, "quotes"),
        ("a:\n\tb: 1\n", 2, "tabs"),
        ("a:\n  mass 1  # kg\n\n  c: 2\n", 4, "line 2 has no colon: `mass: 1`"),
        ("a\n  b:\n    c: 1\n", 2, "line 1 has no colon: `a:`"),
        ("a:\n  mass:1\n  c: 2\n", 3, "line 2: a colon needs a space after it: `mass: 1`"),
        ("a: @b\n", 1, "quotes"),
        ('a: "b\n', 1, "quote"),
        ('a: "C:\\quiet"\n', 1, "single quotes"),
        ('a: "\\ud83d"\n', 1, "escape"),
        ("a: 1\nb: [1, 2\n", 2, "bracket"),
        ("a: {b: 1\nc: 2\n", 2, "bracket"),
    ],
)
def test_broken_yaml_is_located_with_a_hint(text: str, line: int, word: str) -> None:
    found = the_error(text)
    assert (found.code, found.location.line) == ("yaml-syntax", line)
    assert word in found.hint


@pytest.mark.parametrize(
    ("text", "part", "expected"),
    [
        ("k: alpha + beta\n", "beta", (1, 12, "beta")),
        ("größe: 1\nk: θθ + beta\n", "beta", (2, 9, "beta")),
        ("'𝛼𝛼': 1\nk: {x: '𝛼', k: 1}\n", None, None),
        ("k: 'alpha + beta'\n", "beta", (1, 13, "beta")),
        ("k: 'it''s + beta'\n", "beta", (1, 13, "beta")),
        ('k: "alpha + beta"\n', "beta", (1, 13, "beta")),
        ('k: "\\u03b1\\x41 + beta"\n', "beta", (1, 18, "beta")),
        ('k: "\\tA + \\u03b1 A"\n', "α", (1, 11, "\\")),
        ("k: alpha +\n  gamma -\n  beta\n", "beta", (3, 3, "beta")),
        ("k: >-\n  alpha +\n  beta\n", "beta", (3, 3, "beta")),
        ("k: >\n\n  alpha\n\n    beta\n", "beta", (5, 5, "beta")),
        ("k: |\n  alpha\n  beta\n", "beta", (3, 3, "beta")),
        ("k: >-\n  -alpha - beta\n", "-alpha", (2, 3, "-alpha")),
        ("k: |-\n  |beta\n", "|", (2, 3, "|")),
        ("k: >-\r\n  alpha +\r\n  beta\r\n", "beta", (3, 3, "beta")),
        ('k: "alpha +\n   beta"\n', "beta", (2, 4, "beta")),
    ],
)
def test_carets_stand_under_the_part_of_a_scalar(
    text: str, part: str | None, expected: tuple[int, int, str] | None
) -> None:
    if part is None:
        node = yaml_tree.parse(text, "model.yaml").get("k")
        assert isinstance(node, yaml_tree.Mapping)
        key = node.key("k")
        assert key is not None
        assert key.location.column == 13  # characters, not bytes and not UTF-16 units
        return
    assert shown(only_scalar(text), part) == expected


def test_a_spot_behind_the_end_is_shown_at_the_end() -> None:
    at = only_scalar("k: alpha\n").locate(5, 6)
    assert (at.line, at.column) == (1, 9)


def test_an_error_shows_the_line_a_caret_and_the_hint() -> None:
    at = only_scalar("k: alpha + beta\n").locate(8, 12)
    text = diagnostics.Diagnostic("unknown-name", "no `beta`", at, "did you mean `eta`?").render()
    assert text.splitlines() == [
        "model.yaml:1:12: error[unknown-name]: no `beta`",
        "    k: alpha + beta",
        "               ^^^^",
        "  hint: did you mean `eta`?",
    ]


def test_a_long_line_is_shown_around_the_spot() -> None:
    at = only_scalar("k: " + "a+" * 5000 + "beta" + "+a" * 5000 + "\n").locate(10_000, 10_004)
    _, line, carets = diagnostics.Diagnostic("c", "m", at).render().splitlines()
    assert len(line) <= 80
    start = carets.index("^")
    assert line[start : start + carets.count("^")] == "beta"


def columns(text: str) -> int:
    """Columns of a terminal."""
    return sum(0 if unicodedata.combining(c) else 1 + (unicodedata.east_asian_width(c) in "WF") for c in text)


@pytest.mark.parametrize("before", ["", "a + ", "a + " * 40, "\u6c34" * 60, "e\u0301 + " * 50, "\t" * 30])
@pytest.mark.parametrize("after", ["", " + b", " + b" * 40, "\u6c34" * 50])
def test_the_caret_stands_under_the_spot_on_a_terminal_of_80_columns(before: str, after: str) -> None:
    line = f"{before}SPOT{after}"
    at = diagnostics.Location("m.yaml", 1, len(before) + 1, 4, line)
    _, shown, carets = diagnostics.Diagnostic("c", "m", at).render().splitlines()
    assert columns(shown) <= 80
    assert carets.strip() == "^^^^"
    assert columns(shown[: shown.index("SPOT")]) == len(carets) - 4
    wide = diagnostics.Location("m.yaml", 1, 1, 2, "\u6c34\u6c34 = 1")
    assert diagnostics.Diagnostic("c", "m", wide).render().splitlines()[2] == "    ^^^^"


@pytest.mark.parametrize("accents", [1_000, 1_000_000])
def test_characters_without_a_column_do_not_fill_the_excerpt(accents: int) -> None:
    line = "e" + "\u0301" * accents + "SPOT" + "\u0301" * accents
    at = diagnostics.Location("m.yaml", 1, accents + 2, 4, line)
    _, shown, carets = diagnostics.Diagnostic("c", "m", at).render().splitlines()
    assert len(shown) < 700
    assert shown.startswith("    ...")
    assert shown.endswith("...")
    assert carets.strip() == "^^^^"
    assert columns(shown[: shown.index("SPOT")]) == len(carets) - 4


def test_nothing_of_a_file_steers_the_terminal() -> None:
    at = yaml_tree.as_text("a\u202eb\u0085", "model.yaml").locate(0)
    text = diagnostics.Diagnostic("c", "key `\x1b[31m\n`", at, "\x9b").render()
    assert all(c.isprintable() or c == "\n" for c in text)
    assert len(text.splitlines()) == 4


def test_an_equation_that_begins_with_a_bracket_is_told_to_take_quotes():
    text = "lagcli: 1\nholonomic:\n  planes: [a.y, b.y, 0] = 0\n"
    with pytest.raises(diagnostics.ModelError) as caught:
        yaml_tree.parse(text, "m.yaml")
    (found,) = caught.value.diagnostics
    assert (found.location.line, found.location.column) == (3, 25)
    assert found.hint == "an equation that begins with `[` needs quotes"
