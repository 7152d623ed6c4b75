"""Files whole or not at all: written beside their place and then moved there.

Whoever stops a command, or runs out of disk, keeps what was finished and finds no half of a file.
"""

import os
import tempfile
from pathlib import Path

from savgs_ident.core.errors import InputError


def write_bytes(path: Path, content: bytes) -> Path:
    """Write a file whole or not at all; raises :class:`InputError` if it cannot be written."""
    try:
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=".part")
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


def cannot_write(path: Path, error: OSError) -> InputError:
    """The error for a file or folder that refuses."""
    return InputError(
        f"cannot be written: {error.strerror or error}",
        source=path,
        remedy="choose a writable folder with space left: --out DIR",
    )
