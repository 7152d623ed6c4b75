"""MDF campaigns (ASAM, versions 3 and 4): one test a file; the extra ``formats`` installs asammdf, which reads them.

Every channel has its own clock and unit. A channel that is in several groups is taken where it has most samples.
"""

from pathlib import Path
from typing import Any

import numpy as np

from savgs_ident.core.errors import InputError
from savgs_ident.recordings.channels import ChannelMap, Progress, Reader, Reading
from savgs_ident.recordings.signals import Signal, reading_of, test_of


def read_mdf(path: Path, channel_map: ChannelMap, progress: Progress) -> Reading:
    """Read one MDF file; raises :class:`InputError` where it cannot be read or asammdf is not installed."""
    source = str(path)
    try:
        from asammdf import MDF
    except ImportError as error:
        raise InputError(
            "is MDF, which needs the package asammdf",
            source=source,
            remedy="pip install 'savgs-ident[formats]', or export the file as CSV",
        ) from error
    try:
        with MDF(path) as file:
            began = file.header.start_time
            start = began.timestamp() if began is not None else None
            signals = _signals(file, start, progress)
    except Exception as error:
        # The package raises whatever a damaged file makes it do.
        raise InputError(
            f"cannot be read as MDF: {type(error).__name__}: {error}",
            source=source,
            remedy="copy the file again",
        ) from error
    if not signals:
        raise InputError("holds no numbers", source=source, remedy="record again, or give another file")
    return reading_of([(test_of(path), signals)], channel_map, source)


def _signals(file: Any, start: float | None, progress: Progress) -> list[Signal]:
    found: dict[str, Signal] = {}
    total = max(len(file.groups), 1)
    for number, group in enumerate(file.groups):
        for place in range(len(group.channels)):
            each = file.get(group=number, index=place)
            samples = np.asarray(each.samples)
            if samples.ndim != 1 or samples.dtype.kind not in "fiub" or samples.size < 2:
                continue
            known = found.get(each.name)
            if known is None or known.values.size < samples.size:
                time = np.asarray(each.timestamps, dtype=np.float64)
                found[each.name] = Signal(
                    each.name, each.unit or None, time, samples.astype(np.float64), start
                )
        progress((number + 1) / total)
    return list(found.values())


MDF_FILE = Reader(
    name="MDF", suffixes=(".mf4", ".mdf"), magic=(b"MDF     ",), plain_text=False, read=read_mdf
)
