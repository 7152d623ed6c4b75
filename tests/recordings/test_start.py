"""When a campaign began: known from clocks that count from 1970, and from no others."""

from pathlib import Path
from typing import Any

import pytest

from savgs_ident.plants.quarter_car.rig_recordings import load_campaign

LOGGED = 1_763_715_600.0
"""When the campaigns of ``json_messages`` begin [s since 1970]."""


def test_log_times_of_an_mcap_file_say_when_each_test_began(
    tmp_path: Path, signals: Any, write_mcap: Any, json_messages: Any, json_topics: Any
) -> None:
    messages = [
        each
        for place, frequency in enumerate((2.0, 1.0))
        for each in json_messages(signals(frequency), f"dwell_{frequency}Hz", frequency, 60.0 * place)
    ]
    campaign = load_campaign(write_mcap(tmp_path / "a.mcap", json_topics, messages))
    assert {each.name: each.start for each in campaign.recordings} == {
        "dwell_2.0Hz": LOGGED,
        "dwell_1.0Hz": LOGGED + 60.0,
    }
    assert campaign.start == LOGGED
    assert campaign.only(("sprung_accel",)).start == LOGGED


def test_log_times_that_count_from_the_recorders_start_say_nothing(
    tmp_path: Path, signals: Any, write_mcap: Any, json_messages: Any, json_topics: Any
) -> None:
    messages = json_messages(signals(1.0), "dwell_1.0Hz", 1.0, 5.0 - LOGGED)
    campaign = load_campaign(write_mcap(tmp_path / "a.mcap", json_topics, messages))
    assert campaign.start is None


@pytest.mark.parametrize(
    ("origin", "header", "start"),
    [
        (0.0, "time [s]", None),
        (500.0, "time [s]", None),
        (LOGGED, "time [s]", LOGGED),
        (1e3 * LOGGED, "time [ms]", LOGGED),
    ],
)
def test_a_table_says_it_if_its_time_does(
    tmp_path: Path, signals: Any, csv_bytes: Any, origin: float, header: str, start: float | None
) -> None:
    given = signals(1.0)
    given["time"] = origin + given["time"] * (1e3 if header.endswith("[ms]") else 1.0)
    path = tmp_path / "dwell_1.0Hz.csv"
    path.write_bytes(csv_bytes(given, headers={name: name for name in given} | {"time": header}))
    campaign = load_campaign(path)
    assert campaign.start == (None if start is None else pytest.approx(start))
    assert campaign.recordings[0].channels["sprung_accel"].time[0] == pytest.approx(0.0, abs=1e-3)
