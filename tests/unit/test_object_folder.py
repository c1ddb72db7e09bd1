"""The folder of native code: what is not whole, or not the user's own, is not run; what the system refuses costs time
alone."""

from __future__ import annotations

import errno
import os
import sys

import pytest

from lagcli.native import object_folder

NAME = object_folder.key([b"a function", b"a machine"])
posix = pytest.mark.skipif(sys.platform == "win32", reason="Windows keeps files of others by their place")


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    place = tmp_path / "lagcli"
    monkeypatch.setenv("LAGCLI_CACHE", str(place))
    return place


def test_code_that_was_kept_is_read_again(folder):
    assert object_folder.read(NAME) is None
    object_folder.write(NAME, b"code")
    assert object_folder.read(NAME) == b"code"
    assert [file.suffix for file in folder.iterdir()] == [object_folder.ENDING]


def test_the_name_tells_every_part_and_where_it_ends():
    names = {object_folder.key(parts) for parts in ([b"ab", b"c"], [b"a", b"bc"], [b"abc"], [b"abc", b""])}
    assert len(names) == 4


@pytest.mark.parametrize("change", [lambda code: code[:-1], lambda code: code[:-1] + b"x", lambda code: b""])
def test_damaged_code_is_not_read(folder, change):
    object_folder.write(NAME, b"code")
    (file,) = folder.iterdir()
    file.write_bytes(change(file.read_bytes()))
    assert object_folder.read(NAME) is None


@posix
@pytest.mark.parametrize("mode", [0o720, 0o702])
def test_a_folder_that_others_can_write_to_is_not_used(folder, mode):
    object_folder.write(NAME, b"code")
    folder.chmod(mode)
    assert object_folder.read(NAME) is None
    object_folder.write("another", b"code")
    folder.chmod(0o700)
    assert object_folder.read("another") is None
    assert object_folder.read(NAME) == b"code"


@posix
def test_a_file_that_others_can_write_to_and_a_link_are_not_read(folder, tmp_path):
    object_folder.write(NAME, b"code")
    (file,) = folder.iterdir()
    file.chmod(0o666)
    assert object_folder.read(NAME) is None
    file.chmod(0o600)
    elsewhere = tmp_path / "elsewhere"
    file.rename(elsewhere)
    file.symlink_to(elsewhere)
    assert object_folder.read(NAME) is None


def test_a_full_disk_leaves_nothing_behind(folder, monkeypatch):
    def full(source, target):
        raise OSError(errno.ENOSPC, "no space left")

    monkeypatch.setattr(os, "replace", full)
    object_folder.write(NAME, b"code")
    assert list(folder.iterdir()) == []


def test_without_a_home_nothing_is_kept(monkeypatch):
    monkeypatch.delenv("LAGCLI_CACHE")

    def unknown():
        raise RuntimeError("no home")

    monkeypatch.setattr(object_folder.Path, "home", unknown)
    object_folder.write(NAME, b"code")
    assert object_folder.read(NAME) is None
    assert object_folder.contents().folder is None


def test_what_was_used_longest_ago_goes_first(monkeypatch, folder):
    monkeypatch.setattr(object_folder, "MOST_BYTES", 3 * (object_folder.DIGEST + 100))
    for i in range(3):
        object_folder.write(f"code{i}", bytes(100))
        os.utime(folder / f"code{i}{object_folder.ENDING}", (i + 1, i + 1))
    object_folder.read("code0")  # used just now
    object_folder.write("code3", bytes(100))
    assert [object_folder.read(f"code{i}") is not None for i in range(4)] == [True, False, True, True]


def test_contents_and_clear(folder):
    assert object_folder.contents() == object_folder.Contents(folder)
    object_folder.clear()
    for name in ("a", "b"):
        object_folder.write(name, bytes(100))
    contents = object_folder.contents()
    assert (contents.files, contents.size) == (2, 2 * (100 + object_folder.DIGEST))
    (folder / "notes.txt").write_text("of somebody", encoding="utf-8")
    object_folder.clear()
    assert [file.name for file in folder.iterdir()] == ["notes.txt"]
