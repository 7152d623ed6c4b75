"""Read a campaign: a file, or a folder with the files of one visit to the rig.

    campaign = read_campaign("campaign.csv.gz", layout)
    for dwell in campaign.of_kind("dwell"):
        deflection = dwell.channels["susp_deflection"]
        print(dwell.frequency_hz, deflection.time, deflection.values)
    for warning in campaign.warnings:
        print(warning)

Usual names and units are recognised; others are mapped in ``channels.toml`` beside the file (see
:mod:`savgs_ident.recordings.channels`). A new file format is a module with a
:class:`~savgs_ident.recordings.channels.Reader` and one line in ``READERS``.
"""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from savgs_ident.core.errors import DataWarning, InputError
from savgs_ident.recordings.channels import (
    FILE_NAME,
    AbsentSignalError,
    ChannelMap,
    Progress,
    Reader,
    Reading,
    read_channel_map,
)
from savgs_ident.recordings.checks import screen
from savgs_ident.recordings.csv import CSV
from savgs_ident.recordings.mat import MAT
from savgs_ident.recordings.mcap import MCAP
from savgs_ident.recordings.mdf import MDF_FILE
from savgs_ident.recordings.parquet import PARQUET
from savgs_ident.recordings.recording import Campaign, Recording, RecordingLayout
from savgs_ident.recordings.rosbag import ROSBAG
from savgs_ident.recordings.tdms import TDMS

READERS: tuple[Reader, ...] = (
    CSV,
    MCAP,
    ROSBAG,
    PARQUET,
    MAT,
    TDMS,
    MDF_FILE,
)


def read_campaign(
    path: Path | str,
    layout: RecordingLayout,
    channel_map: ChannelMap | Path | str | None = None,
    *,
    progress: Progress | None = None,
) -> Campaign:
    """Read and check everything at ``path``.

    ``path`` is a CSV (plain or gzipped) or MCAP file, or a folder of such files, each with a test or several.
    ``layout`` says which channels the tests of the plant have; a map may have free ones besides.
    ``channel_map`` is a map, or the path of one; without it, a ``channels.toml`` beside the file (or in the
    folder) is used if there is one. ``progress`` is called with the fraction read, 0 to 1.

    Channels are in SI, time in [s] from the start of each test; see :class:`Recording`. Raises
    :class:`InputError`, which names file, test, channel and time, and what to do.
    """
    path = Path(path)
    try:
        files = campaign_files(path)
        the_map = _map_for(path, layout, channel_map)
        readings = _read_files(files, the_map, progress or (lambda fraction: None))
        digest = digest_files(files)
    except OSError as error:
        raise InputError(
            f"cannot be read: {error.strerror or error}",
            source=path,
            remedy="check the path and its permissions",
        ) from error
    readings = _with_rests_apart(files, readings)
    _check_unique(files, readings)
    recordings, found = _screen_all(files, the_map.layout, readings)
    reported = tuple(warning for reading in readings for warning in reading.warnings)
    return Campaign(str(path), recordings, (*reported, *found), digest, the_map.layout)


def _map_for(path: Path, layout: RecordingLayout, channel_map: ChannelMap | Path | str | None) -> ChannelMap:
    if isinstance(channel_map, ChannelMap):
        return channel_map
    if channel_map is not None:
        return read_channel_map(channel_map, layout)
    beside = map_beside(path)
    return ChannelMap(layout) if beside is None else read_channel_map(beside, layout)


def map_beside(path: Path) -> Path | None:
    """The ``channels.toml`` that is used for the campaign at ``path`` where none is named; None if there is none."""
    beside = (path if path.is_dir() else path.parent) / FILE_NAME
    return beside if beside.is_file() else None


def _read_files(files: Sequence[Path], channel_map: ChannelMap, progress: Progress) -> list[Reading]:
    """What the files hold. Free channels may be absent in some of them, with a warning, and not in all."""
    readings, lacking = [], list[Mapping[str, AbsentSignalError]]()
    for index, file in enumerate(files):

        def report(fraction: float, index: int = index) -> None:
            progress((index + fraction) / len(files))

        reading, absent = _read_file(file, channel_map, report)
        readings.append(reading)
        lacking.append(absent)
    for name in channel_map.layout.free:
        if all(name in absent for absent in lacking):
            raise lacking[0][name]
    progress(1.0)
    return [
        replace(
            each, warnings=(*each.warnings, *(e.as_warning("free_channel_absent") for e in absent.values()))
        )
        for each, absent in zip(readings, lacking, strict=True)
    ]


def _read_file(
    file: Path, channel_map: ChannelMap, progress: Progress
) -> tuple[Reading, Mapping[str, AbsentSignalError]]:
    """What a file holds, and why it lacks the free channels that it does not have, by name."""
    try:
        return choose_reader(file).read(file, channel_map, progress), {}
    except AbsentSignalError as error:
        if error.channel not in channel_map.layout.free:
            raise
        others = tuple(each for each in channel_map.rules if each.channel != error.channel)
        reading, absent = _read_file(file, replace(channel_map, rules=others), progress)
        return reading, {error.channel: error, **absent}


def choose_reader(path: Path) -> Reader:
    """The reader of ``path``: by its first bytes, else, for plain text, by its suffix.

    Raises :class:`InputError` where no reader takes the file, or its bytes contradict its suffix.
    """
    with path.open("rb") as stream:
        head = stream.read(16)
    name = path.name.lower()
    for reader in READERS:
        if head.startswith(reader.magic):
            return reader
    for reader in READERS:
        if not name.endswith(reader.suffixes):
            continue
        if reader.plain_text:
            return reader
        what = "is empty" if not head else f"is not an {reader.name} file: its first bytes are {head[:8]!r}"
        raise InputError(what, source=path, remedy="copy the file again, or give another")
    raise InputError(
        f"has a suffix that no reader knows ('{path.suffix}')",
        source=path,
        remedy="give " + ", ".join(suffix for reader in READERS for suffix in reader.suffixes),
    )


def campaign_files(path: Path) -> list[Path]:
    """The files that make up the campaign at ``path``, a file or a folder; :class:`InputError` if there are none."""
    if not path.exists():
        raise InputError("does not exist", source=path, remedy="check the path")
    if path.is_file():
        return [path]
    if not path.is_dir():
        raise InputError("is neither a file nor a folder", source=path, remedy="give a CSV or MCAP file")
    files = sorted(entry for entry in path.iterdir() if is_campaign_file(entry))
    if not files:
        raise InputError("the folder holds no campaign", source=path, remedy="put CSV or MCAP files into it")
    return files


def is_campaign_file(path: Path) -> bool:
    """Whether a file in a folder has the suffix of a recording."""
    return path.is_file() and path.name.lower().endswith(tuple(s for r in READERS for s in r.suffixes))


def _with_rests_apart(files: Sequence[Path], readings: Sequence[Reading]) -> list[Reading]:
    """The readings of several files, a standstill of which has the name of its file where another has one, too."""
    still = [each.name for reading in readings for each in reading.recordings if each.kind == "standstill"]
    found = []
    for file, reading in zip(files, readings, strict=True):
        names = {name: f"{name} of {file.name}" for name in still if still.count(name) > 1}
        renamed = tuple(replace(each, name=names.get(each.name, each.name)) for each in reading.recordings)
        found.append(replace(reading, recordings=renamed))
    return found


def _check_unique(files: Sequence[Path], readings: Sequence[Reading]) -> None:
    """The same test in two files is one recording in two formats, or two campaigns: an error."""
    owner: dict[str, Path] = {}
    for file, reading in zip(files, readings, strict=True):
        for recording in reading.recordings:
            if recording.name in owner:
                raise InputError(
                    f"the test is in {owner[recording.name].name} and in {file.name}",
                    source=file.parent,
                    test=recording.name,
                    remedy="give one of the files, or one folder for each campaign",
                )
        owner |= {recording.name: file for recording in reading.recordings}


def _screen_all(
    files: Sequence[Path], layout: RecordingLayout, readings: Sequence[Reading]
) -> tuple[tuple[Recording, ...], tuple[DataWarning, ...]]:
    """Screen together, so that a standstill in one file serves the dwells in the others."""
    source = str(files[0] if len(files) == 1 else files[0].parent)
    return screen([each for reading in readings for each in reading.recordings], layout, source)


def digest_files(files: Sequence[Path]) -> str:
    """The digest (SHA-256, hexadecimal) of the content of ``files``, as :attr:`Campaign.sha256` has it."""
    digests = []
    for file in files:
        with file.open("rb") as stream:
            digests.append(hashlib.file_digest(stream, "sha256").hexdigest())
    return digests[0] if len(digests) == 1 else hashlib.sha256("".join(digests).encode()).hexdigest()


def map_digest(path: Path, channels: Path | None) -> str | None:
    """The digest of the map for the campaign at ``path``: ``channels``, or the one beside it; None if there is none.

    Raises :class:`OSError` where it cannot be read.
    """
    used = channels or map_beside(path)
    return None if used is None else digest_files([used])
