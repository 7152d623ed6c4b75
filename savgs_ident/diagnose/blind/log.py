"""A campaign on disk, in the form in which the rig's own is shipped: one table, gzipped.

The same recordings give the same bytes. Numbers are written to what the logger resolves.
"""

import gzip
import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from savgs_ident.core.files import write_bytes
from savgs_ident.recordings.recording import Recording

FILE = "campaign.csv.gz"

DECIMALS = {
    "time": 5,
    "road_height": 6,
    "sprung_accel": 4,
    "susp_deflection": 6,
    "link_angle": 6,
}
"""Decimals of each column in its SI unit."""


def write_campaign(recordings: Sequence[Recording], folder: Path) -> Path:
    """Write ``campaign.csv.gz`` into a folder, whole or not at all; its path.

    Raises :class:`InputError` if it cannot be written.
    """
    text = io.StringIO()
    units = {name: channel.unit for name, channel in recordings[0].channels.items()}
    text.write(",".join(["test", "time [s]", *(f"{name} [{unit}]" for name, unit in units.items())]) + "\n")
    for each in recordings:
        channels = [each.channels[name] for name in units]
        table = np.column_stack([channels[0].time, *(channel.values for channel in channels)])
        form = [f"%.{DECIMALS[name]}f" for name in ("time", *units)]
        np.savetxt(text, table, fmt=",".join([each.name, *form]))
    packed = gzip.compress(text.getvalue().encode(), compresslevel=6, mtime=0)
    return write_bytes(folder / FILE, packed)
