"""Writing a file so that it is there whole or not at all. Every command that writes goes through here."""

from __future__ import annotations

import errno
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from impostor.errors import OutputError
from impostor.paths import check_path

try:
    import fcntl
except ImportError:  # Windows, which refuses to delete a file that is open: there no lock is needed.
    fcntl = None

_CANNOT_WRITE = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EROFS}
_NO_HARD_LINKS = {errno.EPERM, errno.EOPNOTSUPP, errno.ENOSYS, errno.EMLINK, errno.EXDEV}


def check_output(path: str | os.PathLike[str], force: bool = False) -> None:
    """Refuse an output that cannot be written, before the work that would fill it.

    Parameters
    ----------
    path : path-like
        Where a file is to be written.
    force : bool
        Allow an existing file to be replaced.

    Raises
    ------
    OutputError
        The file exists and `force` is not given, it is something else than a file, or its directory is missing or
        cannot be written.
    """
    check_path(path)
    final = Path(path)
    if final.is_dir():
        raise OutputError(path, "is a directory; expected a file name")
    if final.exists() and not final.is_file():
        raise OutputError(path, "is not an ordinary file; expected a file name")
    if final.exists() and not force:
        raise OutputError(path, "exists already; expected a new file, or --force to replace it")
    parent = Path(os.path.realpath(final)).parent
    if not parent.is_dir():
        raise OutputError(path, f"directory {str(parent)!r} does not exist; expected one that does")
    if not os.access(parent, os.W_OK | os.X_OK):
        raise OutputError(path, f"directory {str(parent)!r} cannot be written; expected one that can")
    # Not all that can be in the way shows in permissions: a name that is too long, a file system that takes no files.
    temporary = _temporary(Path(os.path.realpath(final)))
    try:
        os.close(os.open(temporary, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o666))
        temporary.unlink()
    except FileExistsError:
        pass  # litter, or another writer: the one who writes finds out
    except OSError as error:
        raise OutputError(path, f"cannot be written: {error.strerror}; expected a file that can") from error


@contextmanager
def atomic_output(path: str | os.PathLike[str], force: bool = False) -> Iterator[Path]:
    """A temporary file that becomes `path` when the block ends well, and vanishes when it does not.

    Parameters
    ----------
    path : path-like
        Where the file is to be. What a killed run left of the same output is removed first.
    force : bool
        Replace an existing file. Without it a file that appears at `path` meanwhile is kept, and the block fails.

    Yields
    ------
    pathlib.Path
        An empty file in the same directory and with the same suffix, named `.impostor-PID.NAME`, to be opened by name.

    Raises
    ------
    OutputError
        As `check_output`; the disk is full; or `path` appeared while the block ran.
    """
    check_output(path, force)
    final = Path(os.path.realpath(path))
    temporary = _temporary(final)
    try:
        _remove_litter(final)
        descriptor = os.open(temporary, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o666)
    except FileExistsError:
        raise OutputError(path, f"{temporary.name!r} is in the way; expected no other writer of this file") from None
    except OSError as error:
        raise OutputError(path, f"cannot be written: {error.strerror}; expected a file that can") from error
    try:
        with open(descriptor, "r+b") as held:
            _lock(held.fileno())
            yield temporary
            os.fsync(held.fileno())
            if fcntl is None:
                held.close()  # Windows gives no open file another name
            _publish(temporary, final, force)
    except OSError as error:
        if error.errno not in _CANNOT_WRITE:
            raise
        raise OutputError(path, f"cannot be written: {error.strerror}") from error
    finally:
        temporary.unlink(missing_ok=True)


def _temporary(final: Path) -> Path:
    return final.with_name(f".impostor-{os.getpid()}.{final.name}")


def _lock(descriptor: int) -> bool:
    """Hold a file for as long as this process lives; False when another process holds it."""
    if fcntl is None:
        return True
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


def _remove_litter(final: Path) -> None:
    """Remove temporary files of this output that no living process holds.

    The lock tells, not the process number in the name: numbers are used again, in containers at once.
    """
    pattern = re.compile(rf"\.impostor-\d+\.{re.escape(final.name)}")
    with os.scandir(final.parent) as entries:
        left = [
            entry.path for entry in entries if pattern.fullmatch(entry.name) and entry.is_file(follow_symlinks=False)
        ]
    for path in left:
        with suppress(OSError), open(path, "r+b") as held:
            if _lock(held.fileno()):
                os.unlink(path)


def _publish(temporary: Path, final: Path, force: bool) -> None:
    """Give the finished file its name; without `force` never in the place of another."""
    if force:
        os.replace(temporary, final)
        return
    try:
        _claim(temporary, final)
    except FileExistsError:
        raise OutputError(final, "appeared while it was being written; expected a new file, or --force") from None


def _claim(temporary: Path, final: Path) -> None:
    try:
        os.link(temporary, final)
    except OSError as error:
        if error.errno not in _NO_HARD_LINKS:
            raise
        # Some file systems have no hard links: take the name first, which fails when it is taken, then fill it.
        os.close(os.open(final, os.O_CREAT | os.O_EXCL))
        os.replace(temporary, final)
