"""The result of a campaign on disk: whole with the digest of what it was made from, or not there.

In the folder of a campaign, ``done.json`` is written last and holds the digests of the other two files, so that a
folder without it, or with a file that is not the one it names, counts as nothing.
"""

import hashlib
import json
import shutil
import tempfile
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from savgs_ident.core.files import cannot_write, is_begun, to_json
from savgs_ident.recordings.read import campaign_files, digest_files, map_digest
from savgs_ident.recordings.recording import unix_time

FILES = ("fit.json", "model.toml")
"""What a result is made of."""

_SEAL = "done.json"
_PART = ".part"

_IN_USE_S = 60.0
"""What was touched so lately [s] may be in use: it is written in a moment, and then moved to its place."""


@dataclass(frozen=True)
class MadeFrom:
    """What a result follows from: digests of the recordings, the map of their channels, the rig, and the settings.

    ``files`` are the names of the recordings' files: tests may be named after them.
    """

    data_sha256: str
    files: tuple[str, ...]
    channels_sha256: str | None
    rig_sha256: str
    settings: Mapping[str, object]

    @property
    def digest(self) -> str:
        """One digest of it all."""
        return hashlib.sha256(json.dumps(vars(self), sort_keys=True, default=dict).encode()).hexdigest()


@dataclass(frozen=True)
class Kept:
    """A result: what is in its two files, and when the recording began [s since 1970, UTC], None if not known."""

    fit: str
    model: str
    start: float | None

    @property
    def record(self) -> dict[str, Any]:
        """What ``fit.json`` says."""
        record: dict[str, Any] = json.loads(self.fit)
        return record


def made_from(path: Path, channels: Path | None, rig: bytes, settings: Mapping[str, object]) -> MadeFrom:
    """What the campaign at ``path`` would be made from now.

    Raises :class:`InputError` where there is none, :class:`OSError` where it cannot be read.
    """
    files = campaign_files(path)
    return MadeFrom(
        digest_files(files),
        tuple(ascii(file.name) for file in files),
        map_digest(path, channels),
        hashlib.sha256(rig).hexdigest(),
        settings,
    )


def kept_result(folder: Path, digest: str) -> Kept | None:
    """The result in ``folder``, if it is whole and made from what has this ``digest``."""
    try:
        seal = json.loads((folder / _SEAL).read_text("utf-8"))
        texts = [(folder / name).read_bytes() for name in FILES]
        if seal["digest"] != digest or seal["files"] != _digests(texts):
            return None
        start = None if seal["start"] is None else unix_time(float(seal["start"]))
        kept = Kept(texts[0].decode("utf-8"), texts[1].decode("utf-8"), start)
        return kept if "parameters" in kept.record else None
    except (OSError, ValueError, KeyError, TypeError, OverflowError, RecursionError):
        return None


def has_result(folder: Path) -> bool:
    """Whether there is a result in ``folder``, from whatever it was made."""
    return (folder / _SEAL).is_file()


def keep_result(folder: Path, result: Kept, origin: MadeFrom) -> None:
    """Write a result in the place of one that may be there; raises :class:`InputError` if it cannot be written."""
    texts = [result.fit.encode("utf-8", "backslashreplace"), result.model.encode("utf-8")]
    seal = {
        "schema": 1,
        "digest": origin.digest,
        "made_from": vars(origin),
        "start": result.start,
        "files": _digests(texts),
    }
    contents = dict(zip((*FILES, _SEAL), (*texts, to_json(seal).encode()), strict=True))
    try:
        folder.mkdir(exist_ok=True)
        part = Path(tempfile.mkdtemp(dir=folder.parent, prefix=f".{folder.name}.", suffix=_PART))
    except OSError as error:
        raise cannot_write(folder, error) from error
    try:
        for name, content in contents.items():
            (part / name).write_bytes(content)
        # No file of this result ever stands beside one of another.
        for name in (_SEAL, *FILES):
            (folder / name).unlink(missing_ok=True)
        for name in contents:
            (part / name).replace(folder / name)
    except OSError as error:
        raise cannot_write(folder, error) from error
    finally:
        shutil.rmtree(part, ignore_errors=True)


def forget_parts(out: Path, files: Sequence[str]) -> None:
    """Remove what runs that were killed have left half written in ``out``: results, and ``files`` right there.

    What may be somebody else's stays, and so does what another run may be writing at this moment.
    """
    for part in out.glob(f".*{_PART}"):
        with suppress(OSError):
            if time.time() - part.lstat().st_mtime < _IN_USE_S:
                continue
            if part.is_dir():
                names = {each.name for each in part.iterdir()}
                if names and names <= {*FILES, _SEAL}:
                    shutil.rmtree(part)
            elif is_begun(part.name, files):
                part.unlink()


def _digests(texts: list[bytes]) -> dict[str, str]:
    return {name: hashlib.sha256(text).hexdigest() for name, text in zip(FILES, texts, strict=True)}
