"""Locks of the operating system on files that are written for long, so that a second writer is refused.

A lock stands on a file `.NAME.lock` beside the file it is for, which goes when the lock does. The system gives a lock
back when its process ends, however that is: a file that a kill has left is no lock. Where a file system has no locks,
the file itself is one: it is made by one process alone, and after a kill somebody has to remove it.
"""

from __future__ import annotations

import contextlib
import errno
import os
import sys
import zlib
from pathlib import Path
from types import TracebackType
from typing import Self

if sys.platform == "win32":
    import msvcrt

    def _lock(number: int) -> None:
        msvcrt.locking(number, msvcrt.LK_NBLCK, 1)

    def _unlock(number: int) -> None:
        msvcrt.locking(number, msvcrt.LK_UNLCK, 1)
else:
    import fcntl

    def _lock(number: int) -> None:
        fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)

    def _unlock(number: int) -> None:
        fcntl.flock(number, fcntl.LOCK_UN)


BUSY = (errno.EAGAIN, errno.EACCES, errno.EDEADLK)  # what the systems say of a lock that somebody else has
WRITTEN = "another run or sweep is writing it"

_locks: set[FileLock] = set()  # of this process


class FileLock:
    """The lock on a file, from now until `release`; also as a context manager.

    Two of one file exclude each other, in one process too; identity: the numbers of the system for the file that it
    stands on. Raises OSError, with the name of the file, where somebody
    else has it and where its folder cannot be written.
    """

    def __init__(self, target: Path) -> None:
        self._path = path_of(target)
        self._number = self._taken(target)
        status = os.fstat(self._number)
        self.identity = status.st_dev, status.st_ino
        _locks.add(self)

    def _taken(self, target: Path) -> int:
        while True:
            number, is_new = self._opened(target)
            with contextlib.ExitStack() as stack:
                stack.callback(os.close, number)
                try:
                    _lock(number)
                except OSError as error:
                    if error.errno in BUSY and is_new:
                        continue  # somebody has looked at the new file before it was locked, or was faster
                    if error.errno in BUSY:
                        raise OSError(errno.EBUSY, WRITTEN, str(target)) from None
                    if not is_new:
                        raise OSError(error.errno, _left(self._path), str(target)) from None
                # Whoever had the lock before may have removed the file that it stands on.
                if _is_at(self._path, number):
                    stack.pop_all()
                    return number

    def _opened(self, target: Path) -> tuple[int, bool]:
        """The descriptor of the file of the lock, and whether it was made for it."""
        flags = os.O_RDWR | getattr(os, "O_NOFOLLOW", 0)
        while True:
            try:
                return os.open(self._path, flags | os.O_CREAT | os.O_EXCL, 0o666), True
            except FileExistsError:
                with contextlib.suppress(FileNotFoundError):  # it went in between
                    return os.open(self._path, flags), False
            except OSError as error:
                raise OSError(error.errno, error.strerror, str(target)) from error

    def release(self) -> None:
        """Give the lock back; no effect on one that was given back."""
        if self not in _locks:
            return
        _locks.discard(self)
        _give_back(self._path, self._number)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.release()


def path_of(target: Path) -> Path:
    """The file of the lock on a file, which is the same whatever links lead to it."""
    end = Path(os.path.realpath(target))
    name = f".{end.name}.lock"
    if len(os.fsencode(name)) > 255:  # which many file systems do not allow
        name = f".{end.name[:50]}.{zlib.crc32(os.fsencode(name)):08x}.lock"
    return end.with_name(name)


def require_free(target: Path) -> None:
    """Raise OSError, with the name of the file, where another process has the lock on it."""
    path = path_of(target)
    try:
        number = os.open(path, os.O_RDWR | getattr(os, "O_NOFOLLOW", 0))
    except OSError:  # there is none
        return
    status = os.fstat(number)
    if (status.st_dev, status.st_ino) in {lock.identity for lock in list(_locks)}:
        os.close(number)
        return
    try:
        _lock(number)
    except OSError as error:
        os.close(number)
        reason = WRITTEN if error.errno in BUSY else _left(path)
        raise OSError(errno.EBUSY, reason, str(target)) from None
    _give_back(path, number)  # a kill has left the file


def _give_back(path: Path, number: int) -> None:
    """Unlock, close and remove the file of a lock.

    It goes while the lock is there: who opens it later makes a new one, and who has opened it before finds that it is
    gone. Windows removes no open file, and none that somebody else has opened meanwhile.
    """
    is_removed_open = sys.platform != "win32"
    if is_removed_open and _is_at(path, number):
        with contextlib.suppress(OSError):  # its folder takes nothing more
            path.unlink(missing_ok=True)
    with contextlib.suppress(OSError):  # a file system without locks
        _unlock(number)
    os.close(number)
    if not is_removed_open:
        with contextlib.suppress(OSError):
            path.unlink(missing_ok=True)


def release_all() -> None:
    """Give all locks back; for the end of a command."""
    for lock in list(_locks):
        lock.release()


def _left(path: Path) -> str:
    return f"{WRITTEN}, or was killed: this file system has no locks; if nothing writes it, remove {path}"


def _is_at(path: Path, number: int) -> bool:
    """True if a file that is open still has this name."""
    try:
        named, opened = path.lstat(), os.fstat(number)
    except FileNotFoundError:
        return False
    return (named.st_dev, named.st_ino) == (opened.st_dev, opened.st_ino)


def _leave_all() -> None:
    """Close the files in a process that was forked: the locks are those of the process before."""
    while _locks:
        os.close(_locks.pop()._number)


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_leave_all)
