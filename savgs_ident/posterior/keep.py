"""The chain on disk: what a run leaves behind at every step, so that it can be stopped and continued.

The file is HDF5. It is written elsewhere and moved to its place, so that a run that is killed at any moment
leaves the state after some step, whole. The file says what it is a chain of; another problem's is refused.
Behind the HDF5 stands its digest (SHA-256): a file that is not as it was written is refused before HDF5 reads it.
"""

import hashlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path

import h5py
import numpy as np

from savgs_ident.core.errors import InputError
from savgs_ident.core.files import scratch_folder, write_bytes

_ATTRIBUTE = "savgs_ident_case"
_DIGEST = hashlib.sha256().digest_size


class Keep:
    """The chain file at ``path`` for the case with digest ``case``; ``counts`` are (evaluations, unsolved).

    Without a path nothing is kept.
    """

    def __init__(self, path: Path | None, case: str, content: bytes | None, counts: tuple[int, int]) -> None:
        self.path, self.case, self.content, self.counts = path, case, content, counts

    @contextmanager
    def scratch(self) -> Iterator[Path]:
        """A file to write to, which holds what was kept so far."""
        with scratch_folder() as folder:
            file = folder / "chain.h5"
            if self.content is not None:
                file.write_bytes(self.content)
            yield file

    def publish(self, scratch: Path, counts: tuple[int, int]) -> None:
        """Make the scratch file the kept one."""
        if self.path is None:
            return
        with h5py.File(scratch, "a") as file:
            file.attrs[_ATTRIBUTE] = self.case
            file.attrs["counts"] = counts
        content = scratch.read_bytes()
        write_bytes(self.path, content + hashlib.sha256(content).digest())


def new_keep(path: Path | None, case: str) -> Keep:
    """A keep that begins empty; what was there is replaced after the first step."""
    return Keep(path, case, None, (0, 0))


def open_keep(path: Path, case: str) -> Keep:
    """The keep of an earlier run; an empty one if that was stopped before its first step.

    Raises :class:`InputError` if it cannot be read or is the chain of another case.
    """
    try:
        content = _whole(path.read_bytes())
        with h5py.File(BytesIO(content), "r") as file:
            kept, counts = file.attrs[_ATTRIBUTE], file.attrs["counts"]
    except FileNotFoundError:
        return new_keep(path, case)
    except (OSError, KeyError, ValueError) as error:
        raise InputError(
            f"is no chain that can be resumed: {error}", source=path, remedy="leave out --resume"
        ) from error
    if kept != case:
        raise InputError(
            "is the chain of other data, another model, other options or another version",
            source=path,
            remedy="resume with what it was begun with, or leave out --resume",
        )
    return Keep(path, case, content, (int(counts[0]), int(counts[1])))


def _whole(content: bytes) -> bytes:
    """A file's content without the digest that it ends with; ``ValueError`` if it is not of this content."""
    begun, digest = content[:-_DIGEST], content[-_DIGEST:]
    if hashlib.sha256(begun).digest() != digest:
        raise ValueError("it is not as it was written")
    return begun


def digest_of(parts: Mapping[str, object]) -> str:
    """A digest of named numbers, arrays and texts."""
    digest = hashlib.sha256()
    for name, value in parts.items():
        digest.update(name.encode())
        digest.update(value.tobytes() if isinstance(value, np.ndarray) else repr(value).encode())
    return digest.hexdigest()
