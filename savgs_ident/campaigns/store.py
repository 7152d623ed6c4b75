"""Campaigns on disk: which ones the arguments of ``campaign`` mean, what each is called, and what is stored of it.

A file is a campaign. A folder is one too, or holds several: a campaign in each subfolder, and

- its files together are one campaign if any is named after a test (``dwell_2.35Hz.csv``, ``standstill.csv``);
- otherwise each file is a campaign of its own.

The table that an earlier run wrote is no campaign, and results are not written where recordings are. A campaign is
named after its file or folder, in characters that every file system takes:

>>> safe_name("../../etc/pass wd"), safe_name("Run 7"), safe_name("..")
('etc_pass_wd', 'Run_7', 'campaign')

Each has a folder of this name for its result, which is there whole, with the digest of what it was made from, or not
at all: ``done.json`` is written last and holds the digests of the other two files, so that a folder without it, or
with a file that is not the one it names, counts as nothing.
"""

import hashlib
import json
import os
import re
import shutil
import tempfile
import time
import unicodedata
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from savgs_ident.core.errors import InputError
from savgs_ident.core.files import cannot_write, is_begun, spelled_out, to_json
from savgs_ident.recordings.read import READERS, campaign_files, digest_files, is_campaign_file, map_digest
from savgs_ident.recordings.recording import classify_test, unix_time

LONGEST_NAME = 80
"""Most bytes of a name, so that there is room for what makes it unique, and for the names of its files."""

_RECORD, _TABLES = "campaign.json", ("campaigns.csv", "campaigns.parquet")
"""What an earlier run has left together."""

_RESERVED = ("con", "prn", "aux", "nul", *(f"{port}{n}" for port in ("com", "lpt") for n in range(10)))
"""Names that are devices on Windows."""


@dataclass(frozen=True)
class Found:
    """A campaign: its ``path`` as ``fit`` takes it, and its ``name``, unique and safe for file systems."""

    path: Path
    name: str

    @property
    def source(self) -> str:
        """The path as text that can be written anywhere; bytes that are no text are spelled out."""
        return spelled_out(self.path)


def find_campaigns(arguments: Sequence[Path], taken: Iterable[str] = ()) -> tuple[Found, ...]:
    """The campaigns, each once, in the order of their names; runs 2 and 10 in the order of their numbers.

    ``taken`` are names that may not be given away. Raises :class:`InputError` for an argument that does not exist or
    holds no campaign.
    """
    paths: dict[Path, Path] = {}
    for argument in arguments:
        try:
            for path in _campaigns_at(argument):
                paths.setdefault(path.resolve(), path)
        except OSError as error:
            raise InputError(
                f"cannot be read: {error.strerror or error}",
                source=argument,
                remedy="check the path and its permissions",
            ) from error
    names = _unique_names(list(paths), frozenset(taken))
    found = [Found(path, name) for path, name in zip(paths.values(), names, strict=True)]
    return tuple(sorted(found, key=lambda each: in_natural_order(each.name)))


def check_apart(out: Path, arguments: Sequence[Path], found: Sequence[Found], files: Sequence[str]) -> None:
    """Raise :class:`InputError` if results would get among or over recordings.

    They are written to ``files`` in the folder ``out``, and to a folder in it for each that was ``found`` at the
    ``arguments``.
    """
    read = {os.path.realpath(path) for path in (*arguments, *(each.path for each in found))}
    for written in (out, *(out / name for name in files), *(out / each.name for each in found)):
        if os.path.realpath(written) in read:
            raise InputError(
                "is where recordings are read, and results would be written there",
                source=written,
                remedy="name another folder: --out DIR",
            )


def in_natural_order(name: str) -> tuple[tuple[int, int | str], ...]:
    """A key by which ``run2`` comes before ``run10``."""
    parts = re.split(r"([0-9]+)", name.casefold())
    return tuple((1, part) if place % 2 == 0 else (0, int(part)) for place, part in enumerate(parts) if part)


def safe_name(text: str) -> str:
    """``text`` of letters, digits, dots, dashes and underscores, at most :data:`LONGEST_NAME` bytes long."""
    plain = unicodedata.normalize("NFC", text)
    kept = re.sub("_+", "_", "".join(each if each.isalnum() or each in ".-_" else "_" for each in plain))
    kept = kept.encode("utf-8", "ignore")[:LONGEST_NAME].decode("utf-8", "ignore").strip("._- ")
    return kept if kept and kept.split(".")[0].casefold() not in _RESERVED else f"campaign_{kept}".rstrip("_")


def _campaigns_at(argument: Path) -> list[Path]:
    if argument.is_file():
        return [argument]
    if not argument.exists():
        raise InputError("does not exist", source=argument, remedy="check the path")
    if not argument.is_dir():
        raise InputError("is neither a file nor a folder", source=argument, remedy="give a CSV or MCAP file")
    found = _campaigns_in(argument)
    for folder in sorted(argument.iterdir()):
        if folder.is_dir() and not folder.name.startswith(".") and _files(folder):
            found.append(folder)
    if not found:
        raise InputError(
            "the folder holds no campaign",
            source=argument,
            remedy="put recordings into it, or into a folder for each campaign in it",
        )
    return found


def _campaigns_in(folder: Path) -> list[Path]:
    """The campaigns that the files right in a folder make up."""
    files = _files(folder)
    if any(classify_test(_stem(file))[0] != "other" for file in files):
        return [folder]
    return files


def _files(folder: Path) -> list[Path]:
    """The recordings right in a folder; the tables that an earlier run wrote are none."""
    own = _TABLES if (folder / _RECORD).is_file() else ()
    return sorted(
        each
        for each in folder.iterdir()
        if each.name not in own and not each.name.startswith(".") and is_campaign_file(each)
    )


def _stem(path: Path) -> str:
    """The name of a file without the suffix that a reader knows; that of a folder as it is."""
    name = os.path.basename(path)
    suffixes = [suffix for reader in READERS for suffix in reader.suffixes if name.lower().endswith(suffix)]
    return name[: -max(map(len, suffixes))] if suffixes and not path.is_dir() else name


def _unique_names(paths: Sequence[Path], taken: frozenset[str]) -> list[str]:
    """Names that no file system confuses: the own one, else with that of the folder, else with a digest of the path.

    Whoever shares a name loses it, so that none depends on the order of the arguments.
    """
    choices = [
        (
            safe_name(_stem(path)),
            safe_name(f"{path.parent.name}_{_stem(path)}"),
            f"{safe_name(_stem(path))}_{hashlib.sha256(os.fsencode(path)).hexdigest()[:12]}",
        )
        for path in paths
    ]
    names = [choice[0] for choice in choices]
    for level in (1, 2):
        count = Counter(name.casefold() for name in names)
        names = [
            choice[level] if count[name.casefold()] > 1 or name.casefold() in taken else name
            for name, choice in zip(names, choices, strict=True)
        ]
    return names


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
class StoredResult:
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


def load_result(folder: Path, digest: str) -> StoredResult | None:
    """The result in ``folder``, if it is whole and made from what has this ``digest``."""
    try:
        seal = json.loads((folder / _SEAL).read_text("utf-8"))
        texts = [(folder / name).read_bytes() for name in FILES]
        if seal["digest"] != digest or seal["files"] != _digests(texts):
            return None
        start = None if seal["start"] is None else unix_time(float(seal["start"]))
        stored = StoredResult(texts[0].decode("utf-8"), texts[1].decode("utf-8"), start)
        return stored if "parameters" in stored.record else None
    except (OSError, ValueError, KeyError, TypeError, OverflowError, RecursionError):
        return None


def has_result(folder: Path) -> bool:
    """Whether there is a result in ``folder``, from whatever it was made."""
    return (folder / _SEAL).is_file()


def save_result(folder: Path, result: StoredResult, origin: MadeFrom) -> None:
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
