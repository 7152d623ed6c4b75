"""A long MCAP file is read in memory for its numbers, not for its messages."""

import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from benchmarks.write_long_mcap import write_long_mcap
from savgs_ident.plants.quarter_car.rig_recordings import load_campaign
from savgs_ident.recordings.mcap_records import McapRecords

BYTES_A_SAMPLE = 6 * 8 + 3 * 8
"""Six values, their time, and the two clocks that are held until the time is chosen [bytes]."""


@pytest.fixture(scope="module")
def long_mcap(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, int]:
    path = tmp_path_factory.mktemp("long") / "long.mcap"
    return path, write_long_mcap(path, minutes=3.0, rate_hz=500.0)


def _peak(work: Callable[[], object]) -> int:
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.slow
def test_peak_is_the_result_and_a_few_buffers(long_mcap: tuple[Path, int]) -> None:
    path, samples = long_mcap
    buffers = 24 << 20
    assert _peak(lambda: load_campaign(path)) < samples * BYTES_A_SAMPLE + buffers


def test_the_container_is_read_in_the_memory_of_a_chunk(long_mcap: tuple[Path, int]) -> None:
    path, _ = long_mcap

    def read() -> None:
        for _ in McapRecords(path, lambda fraction: None):
            pass

    assert _peak(read) < 8 << 20


def test_the_long_campaign_is_whole_and_sound(long_mcap: tuple[Path, int]) -> None:
    path, samples = long_mcap
    campaign = load_campaign(path)
    assert campaign.warnings == ()
    assert [r.frequency_hz for r in campaign.recordings] == [0.5, 1.0, 1.5]
    assert sum(r.channels["sprung_accel"].values.size for r in campaign.recordings) == samples
    for recording in campaign.recordings:
        time = recording.channels["road_height"].time
        expected = 0.01375 * np.cos(2 * np.pi * (recording.frequency_hz or 0.0) * time)
        np.testing.assert_allclose(recording.channels["road_height"].values, expected, atol=6e-7)
