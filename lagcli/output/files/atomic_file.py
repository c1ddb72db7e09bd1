"""Files written aside and moved into place, so that a target is either the old file or the whole new one, and locks
of the operating system on files that are written for long, so that a second writer is refused.

A lock stands on a file `.NAME.lock` beside the file it is for. The system gives it back when its process ends: a file
that a kill has left is no lock. Where a file system has no locks, the file itself is one: one process alone makes it,
and after a kill somebody has to remove it.
"""

from __future__ import annotations

import contextlib
import errno
import io
import os
import stat
import sys
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Self

from lagcli.output.files import interrupts

MOST_LINKS = 40  # links to links that are followed, as many as Linux follows
PERMISSIONS = 0o777  # what is kept of a mode: a set-user-ID bit was given to the old content and its owner

_begun: set[Path] = set()  # files aside that have been neither moved nor removed
BUSY = (errno.EAGAIN, errno.EACCES, errno.EDEADLK)  # what the systems say of a lock that somebody else has
WRITTEN = "another run or sweep is writing it"


class PendingFile:
    """An empty file of its own beside ``target``; write to ``path``, then commit, keep_partial or discard.

    The file that a link names is replaced, and the link stays. A pipe or a device is written in place. Raises OSError,
    with the name of the target, as `destination` and `require_free`, and where the folder cannot be written.
    """

    def __init__(self, target: Path) -> None:
        self._target = destination(target)
        # The target itself is written, so that writing may have to wait for a reader.
        self.is_in_place = not is_replaced(self._target)
        if self.is_in_place:
            self.path = self._target
            return
        require_free(self._target)
        # The name is cut because many file systems allow only 255 bytes in one.
        name = f".{self._target.name[:50]}.{os.urandom(4).hex()}.tmp"
        self.path = self._target.with_name(name)
        # Known before it is made: an interrupt in between leaves nothing that `sweep` does not find.
        _begun.add(self.path)
        try:
            # 0o666 under the umask: the permissions of any new file, which tempfile.mkstemp would not give.
            os.close(os.open(self.path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
        except OSError as error:
            with contextlib.suppress(OSError):  # the folder takes nothing; the error that led here says so
                self.discard()
            raise OSError(error.errno, error.strerror, str(target)) from error

    def commit(self, durably: bool = False) -> None:
        """Move the file into the place of the target, with the permissions and the owner that had. durably: return when
        it is on the disk."""
        if self.is_in_place:
            return
        if durably:
            with self.path.open("r+b") as file:
                os.fsync(file.fileno())
        if self._target.exists():
            _take_over(self.path, self._target.stat())
        os.replace(self.path, self._target)
        _begun.discard(self.path)
        if durably and os.name == "posix":  # the names in the folder too
            number = os.open(self._target.parent, os.O_RDONLY)
            try:
                with contextlib.suppress(OSError):  # some file systems have no such call for folders
                    os.fsync(number)
            finally:
                os.close(number)

    def keep_partial(self) -> Path:
        """Move the file to the target's name with ``.partial`` after it, and return that path."""
        if self.is_in_place:
            return self._target
        partial = partial_of(self._target)
        os.replace(self.path, partial)
        _begun.discard(self.path)
        return partial

    def discard(self) -> None:
        """Remove the file; the target is as it was."""
        if not self.is_in_place:
            self.path.unlink(missing_ok=True)
            _begun.discard(self.path)


def put(file: io.RawIOBase, data: bytes | memoryview) -> None:
    """Write all bytes to a file without a buffer: a nearly full disk may take a part, and the next call tells why."""
    rest = memoryview(data)
    while rest:
        rest = rest[file.write(rest) :]


def write(target: Path, content: bytes, durably: bool = False) -> None:
    """Write a file as a whole: aside, and moved into place. Raises OSError; the target is as it was then."""
    file = PendingFile(target)
    with undone_by(file.discard):
        file.path.write_bytes(content)
        file.commit(durably)


@contextlib.contextmanager
def undone_by(undo: Callable[[], object]) -> Iterator[None]:
    """Call `undo` where the block fails, of an interrupt too; the exception goes on."""
    with contextlib.ExitStack() as stack:
        stack.callback(undo)
        yield
        stack.pop_all()


def sweep() -> None:
    """Remove the files aside whose writers were interrupted, and their locks; for the end of a command."""
    while _begun:
        _begun.pop().unlink(missing_ok=True)
    release_all()


interrupts.before_end(sweep)


def is_replaced(target: Path) -> bool:
    """True if a target is replaced by a new file; a pipe or a device is written in place."""
    return target.is_file() or not target.exists()


def partial_of(target: Path) -> Path:
    """The path of the rows of a run that was broken off."""
    return target.with_name(target.name + ".partial")


def destination(target: Path) -> Path:
    """The file that is replaced where ``target`` is written: itself, or what its links lead to.

    Raises OSError, with the name of the target, for a directory, a file that the user may not write or replace, a link
    that leads to itself, and a link that `is_foreign`, which Linux with ``fs.protected_symlinks`` does not follow
    either.
    """
    end = target
    for _ in range(MOST_LINKS):
        if not end.is_symlink():
            break
        if is_foreign(end.lstat(), end.parent.stat(), _user()):
            reason = "it is a link of somebody else, in a folder where everybody may make links"
            raise PermissionError(errno.EACCES, reason, str(target))
        end = end.parent / os.readlink(end)
    else:
        raise OSError(errno.ELOOP, os.strerror(errno.ELOOP), str(target))
    if end is not target:
        end = Path(os.path.realpath(end))
    if end.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(target))
    if end.is_file() and (reason := protection(end.stat(), end.parent.stat(), _user())):
        raise PermissionError(errno.EACCES, reason, str(target))
    return end


def is_foreign(link: os.stat_result, folder: os.stat_result, user: int | None) -> bool:
    """True if a link must not be followed: others may make links in its folder, and it is neither the user's nor of
    the owner of the folder. ``user`` is None where users have no numbers."""
    is_shared = bool(folder.st_mode & stat.S_ISVTX and folder.st_mode & stat.S_IWOTH)
    return user is not None and is_shared and link.st_uid not in (user, folder.st_uid)


def protection(file: os.stat_result, folder: os.stat_result, user: int | None) -> str:
    """The reason why the user must not replace a file, or an empty text. For root its owner's permission counts: a
    protected file was protected on purpose."""
    if user is None or user in (0, file.st_uid):
        may_write = bool(file.st_mode & stat.S_IWUSR)
    else:
        in_group = file.st_gid in (os.getegid(), *os.getgroups())
        may_write = bool(file.st_mode & (stat.S_IWGRP if in_group else stat.S_IWOTH))
    if not may_write:
        return "it is write-protected"
    if folder.st_mode & stat.S_ISVTX and user is not None and user not in (0, file.st_uid, folder.st_uid):
        return "it belongs to somebody else, in a folder where only owners may replace files"
    return ""


def _user() -> int | None:
    return os.geteuid() if hasattr(os, "geteuid") else None


def _take_over(path: Path, old: os.stat_result) -> None:
    """Give a new file the owner and the permissions of the one it replaces, as far as the system allows it; without the
    group the permissions of everybody else."""
    mode = stat.S_IMODE(old.st_mode) & PERMISSIONS
    new = path.stat()
    is_same = (new.st_uid, new.st_gid) == (old.st_uid, old.st_gid)
    if not is_same and not _chown(path, old.st_uid, old.st_gid) and not _chown(path, -1, old.st_gid):
        mode = mode & 0o707 | (mode & 0o007) << 3
    os.chmod(path, mode)


def _chown(path: Path, owner: int, group: int) -> bool:
    """Change the owner; whether the system has allowed it."""
    if not hasattr(os, "chown"):
        return True  # there is nothing to change
    try:
        os.chown(path, owner, group)
    except OSError:
        return False
    return True


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


_locks: set[FileLock] = set()  # of this process


class FileLock:
    """The lock on a file, from now until `release`; also as a context manager. Two of one file exclude each other, in
    one process too. Raises OSError, with the name of the file, where somebody else has it and where its folder cannot
    be written."""

    def __init__(self, target: Path) -> None:
        self._path, taken = lock_path(target), -1
        flags = os.O_RDWR | getattr(os, "O_NOFOLLOW", 0)
        while taken < 0:
            try:
                number, is_new = os.open(self._path, flags | os.O_CREAT | os.O_EXCL, 0o666), True
            except FileExistsError:
                try:
                    number, is_new = os.open(self._path, flags), False
                except FileNotFoundError:
                    continue  # it went in between
            except OSError as error:
                raise OSError(error.errno, error.strerror, str(target)) from error
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
                    taken = number
        self._number, self.status = taken, os.fstat(taken)
        _locks.add(self)

    def release(self) -> None:
        """Give the lock back; no effect on one that was given back."""
        if self not in _locks:
            return
        _locks.discard(self)
        _give_back(self._path, self._number)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.release()


def lock_path(target: Path) -> Path:
    """The file of the lock on a file, which is the same whatever links lead to it."""
    end = Path(os.path.realpath(target))
    name = f".{end.name}.lock"
    if len(os.fsencode(name)) > 255:  # which many file systems do not allow
        name = f".{end.name[:50]}.{zlib.crc32(os.fsencode(name)):08x}.lock"
    return end.with_name(name)


def require_free(target: Path) -> None:
    """Raise OSError, with the name of the file, where another process has the lock on it."""
    path = lock_path(target)
    try:
        number = os.open(path, os.O_RDWR | getattr(os, "O_NOFOLLOW", 0))
    except OSError:  # there is none
        return
    status = os.fstat(number)
    if any(os.path.samestat(status, lock.status) for lock in list(_locks)):
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
    """Remove the file of a lock while the lock is there, unlock and close it. Windows removes no open file: it comes
    last there."""
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
        return os.path.samestat(path.lstat(), os.fstat(number))
    except FileNotFoundError:
        return False


def _leave_all() -> None:
    """Close the files in a process that was forked: the locks are those of the process before."""
    while _locks:
        os.close(_locks.pop()._number)


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_leave_all)
