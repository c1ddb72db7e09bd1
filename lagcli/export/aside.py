"""Files written aside and moved into place, so that a target is either the old file or the whole new one."""

import errno
import os
import secrets
import stat
from pathlib import Path


class Aside:
    """An empty file of its own beside ``target``; write to ``path``, then commit, keep_partial or discard.

    A link is followed, so that the file it names is replaced and the link stays. A target that is no regular
    file (a pipe, a device) cannot be replaced and is written in place. Raises OSError, with the name of the
    target, where the folder cannot be written or the target is a directory.
    """

    def __init__(self, target: Path) -> None:
        self._target = Path(os.path.realpath(target)) if target.is_symlink() else target
        if self._target.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(target))
        self._in_place = self._target.exists() and not self._target.is_file()
        if self._in_place:
            self.path = self._target
            return
        # The name is cut because many file systems allow only 255 bytes in one.
        name = f".{self._target.name[:50]}.{secrets.token_hex(4)}.tmp"
        self.path = self._target.with_name(name)
        try:
            # 0o666 under the umask: the rights of any new file, which tempfile.mkstemp would not give.
            os.close(os.open(self.path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
        except OSError as error:
            raise OSError(error.errno, error.strerror, str(target)) from error

    def commit(self) -> None:
        """Move the file into the place of the target, with the access rights the target had."""
        if self._in_place:
            return
        if self._target.exists():
            os.chmod(self.path, stat.S_IMODE(self._target.stat().st_mode))
        os.replace(self.path, self._target)

    def keep_partial(self) -> Path:
        """Move the file to the target's name with ``.partial`` after it, and return that path."""
        if self._in_place:
            return self._target
        partial = self._target.with_name(self._target.name + ".partial")
        os.replace(self.path, partial)
        return partial

    def discard(self) -> None:
        """Remove the file; the target is as it was."""
        if not self._in_place:
            self.path.unlink(missing_ok=True)
