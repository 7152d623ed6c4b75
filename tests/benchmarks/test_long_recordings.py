"""Long recordings in every format hold the same six channels of the rig."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.write_long_recordings import WRITERS, signals
from savgs_ident.plants.quarter_car.rig_recordings import RIG_LAYOUT, load_campaign

MINUTES = 0.05


@pytest.mark.parametrize("name", WRITERS)
def test_what_is_written_is_read(name: str, tmp_path: Path) -> None:
    if name in ("mdf4", "tdms"):
        pytest.importorskip(
            {"mdf4": "asammdf", "tdms": "nptdms"}[name], reason="the extra formats is not installed"
        )
    found = signals(MINUTES)
    (recording,) = load_campaign(WRITERS[name](tmp_path, found)).recordings
    assert recording.kind == "road"
    assert set(recording.channels) == set(RIG_LAYOUT.names) & set(found)
    for channel in recording.channels.values():
        np.testing.assert_allclose(channel.values, found[channel.name], atol=1e-6)
