"""TDMS campaigns (National Instruments): one test a group; the extra ``formats`` installs npTDMS, which reads them.

A channel has the unit of its property ``unit_string``, its clock from ``wf_increment`` and ``wf_start_offset``, or
from a channel of its group that is the time.
"""

from pathlib import Path
from typing import Any

import numpy as np

from savgs_ident.core.errors import InputError
from savgs_ident.recordings.channels import ChannelMap, Progress, Reader, Reading
from savgs_ident.recordings.signals import Signal, reading_of, test_of, without_clash


def read_tdms(path: Path, channel_map: ChannelMap, progress: Progress) -> Reading:
    """Read one TDMS file; raises :class:`InputError` where it cannot be read or npTDMS is not installed."""
    source = str(path)
    try:
        from nptdms import TdmsFile
    except ImportError as error:
        raise InputError(
            "is TDMS, which needs the package npTDMS",
            source=source,
            remedy="pip install 'savgs-ident[formats]', or export the file as CSV",
        ) from error
    try:
        groups = [(group.name, _signals(group)) for group in TdmsFile.read(path).groups()]
    except Exception as error:
        # The package raises whatever a damaged file makes it do.
        raise InputError(
            f"cannot be read as TDMS: {type(error).__name__}: {error}",
            source=source,
            remedy="copy the file again",
        ) from error
    progress(1.0)
    tests = [(name, signals) for name, signals in groups if signals]
    if not tests:
        raise InputError("holds no numbers", source=source, remedy="record again, or give another file")
    if len(tests) == 1:
        # The name of a lone group says less than that of its file.
        tests = [(test_of(path), tests[0][1])]
    return reading_of(tests, channel_map, source)


def _signals(group: Any) -> list[Signal]:
    found = []
    for channel in group.channels():
        if channel.dtype is None or channel.dtype.kind not in "fiub":
            continue
        values = np.asarray(channel[:], dtype=np.float64)
        timed = channel.properties.get("wf_increment", 0.0)
        clock = np.asarray(channel.time_track(), dtype=np.float64) if timed and values.size else None
        unit = channel.properties.get("unit_string") or channel.properties.get("NI_UnitDescription") or None
        start = channel.properties.get("wf_start_time")
        began = None if start is None else float(np.datetime64(start, "us").astype(np.int64)) * 1e-6
        found.append(Signal(channel.name, unit, clock, values, began))
    return without_clash(found)


TDMS = Reader(name="TDMS", suffixes=(".tdms",), magic=(b"TDSm",), plain_text=False, read=read_tdms)
