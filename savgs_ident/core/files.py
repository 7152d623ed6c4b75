"""Files whole or not at all: written beside their place and then moved there.

Whoever stops a command, or runs out of disk, keeps what was finished and finds no half of a file.
"""

import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from fnmatch import fnmatchcase
from glob import escape
from pathlib import Path

from savgs_ident.core.errors import InputError

LEAST_ROOM = 32 * 2**20
"""Space that a temporary folder has to offer [byte]."""


_PART = ".part"


def write_bytes(path: Path, content: bytes) -> Path:
    """Write a file whole or not at all; raises :class:`InputError` if it cannot be written."""
    try:
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=_PART)
    except OSError as error:
        raise cannot_write(path, error) from error
    part = Path(name)
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(content)
        part.chmod(0o644)
        part.replace(path)
    except OSError as error:
        raise cannot_write(path, error) from error
    finally:
        part.unlink(missing_ok=True)
    return path


def is_begun(name: str, of: Iterable[str]) -> bool:
    """Whether a file with this ``name`` is what :func:`write_bytes` had begun of a file ``of`` one of these names."""
    return any(fnmatchcase(name, f".{escape(each)}.????????{_PART}") for each in of)


@contextmanager
def scratch_folder() -> Iterator[Path]:
    """A temporary folder with room for what libraries write to files only, and cannot be trusted to fail at.

    HDF5 takes the process down where a disk fills under it. Raises :class:`InputError` if there is no room.
    """
    with tempfile.TemporaryDirectory(prefix="savgs-ident-") as name:
        if shutil.disk_usage(name).free < LEAST_ROOM:
            raise InputError(
                "the disk is full",
                source=tempfile.gettempdir(),
                remedy="make room there, or name another folder in TMPDIR",
            )
        yield Path(name)


def spelled_out(text: object) -> str:
    r"""``text`` as every file can hold it; a byte of a file name that is no text becomes ``\udcff`` or the like."""
    return str(text).encode("utf-8", "backslashreplace").decode()


def cannot_write(path: Path, error: OSError) -> InputError:
    """The error for a file or folder that refuses."""
    return InputError(
        f"cannot be written: {error.strerror or error}",
        source=path,
        remedy="choose a writable folder with space left: --out DIR",
    )
