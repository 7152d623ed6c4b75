"""Channels that are none of the plant's: named in ``channels.toml``, read like any other, kept apart from fits."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import savgs_ident as si
from savgs_ident.responses.dwells import estimate_response
from savgs_ident.responses.selection import only_tests

from .conftest import Signals

FREE = '[free.oil_temperature]\ncolumn = "T_oil"\nunit = "{}"\nscale = 2\noffset = -3\n'
FREQUENCIES = (1.0, 2.0, 3.0)


@pytest.fixture
def folder(tmp_path: Path, signals: Callable[..., Signals], csv_bytes: Callable[..., bytes]) -> Path:
    """Three dwells, the oil a degree warmer in each."""
    for warmer, frequency in enumerate(FREQUENCIES):
        recorded = signals(frequency)
        recorded["T_oil"] = 20.0 + warmer + 0.01 * recorded["time"]
        (tmp_path / f"dwell_{frequency}Hz.csv").write_bytes(csv_bytes(recorded))
    return tmp_path


def test_they_are_read_in_their_own_unit(folder: Path, signals: Callable[..., Signals]) -> None:
    (folder / "channels.toml").write_text(FREE.format("degC"))
    campaign = si.load_campaign(folder)
    assert (campaign.warnings, campaign.layout.free) == ((), ("oil_temperature",))
    oil = campaign.recordings[1].channels["oil_temperature"]
    assert oil.unit == "degC"
    assert oil.values == pytest.approx(2.0 * (21.0 + 0.01 * signals()["time"]) - 3.0)


def test_a_response_has_their_means_beside_the_same_harmonics(folder: Path) -> None:
    without = estimate_response(si.load_campaign(folder))
    (folder / "channels.toml").write_text(FREE.format("degC"))
    response = estimate_response(si.load_campaign(folder))
    assert (response.channels, response.warnings) == (without.channels, without.warnings)
    assert_array_equal(response.harmonics, without.harmonics)
    wanted = 2.0 * (20.0 + np.arange(3.0) + 0.01 * 4.995) - 3.0
    assert response.beside["oil_temperature"] == pytest.approx(wanted)
    assert only_tests(response, np.array([2])).beside["oil_temperature"] == pytest.approx(wanted[2:])
    assert not without.beside


def test_where_one_was_not_recorded_it_has_no_mean(folder: Path) -> None:
    (folder / "channels.toml").write_text(FREE.format("degC"))
    path = folder / "dwell_2.0Hz.csv"
    header, *rows = path.read_text().splitlines()
    path.write_text("\n".join([header, *(row.rsplit(",", 1)[0] + "," for row in rows)]) + "\n")
    campaign = si.load_campaign(folder)
    assert [each.channel for each in campaign.warnings] == ["oil_temperature"]
    assert_array_equal(np.isnan(estimate_response(campaign).beside["oil_temperature"]), [False, True, False])


def test_where_a_file_lacks_one_it_has_no_mean_and_that_is_said(
    folder: Path, signals: Callable[..., Signals], csv_bytes: Callable[..., bytes]
) -> None:
    (folder / "channels.toml").write_text(FREE.format("degC"))
    (folder / "dwell_2.0Hz.csv").write_bytes(csv_bytes(signals(2.0)))
    campaign = si.load_campaign(folder)
    assert [(each.code, each.channel) for each in campaign.warnings] == [
        ("free_channel_absent", "oil_temperature")
    ]
    assert campaign.warnings[0].source.endswith("dwell_2.0Hz.csv")
    assert_array_equal(np.isnan(estimate_response(campaign).beside["oil_temperature"]), [False, True, False])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (FREE.format("warm"), "unknown unit 'warm'"),
        ('[free.oil]\ncolumn = "T_oil"\n', "has no unit"),
        ('[free.road_height]\ncolumn = "T_oil"\nunit = "K"\n', "'road_height' is the plant's own"),
        ('[free.time]\ncolumn = "T_oil"\nunit = "K"\n', "'time' is the plant's own"),
        ('[free."Oil temp"]\ncolumn = "T_oil"\nunit = "K"\n', "'Oil temp' is the plant's own, or has more"),
        ('[free.oil]\ncolumn = "T_air"\nunit = "K"\n', "'T_air', the file does not have it"),
        ('[free.oil]\nunit = "K"\n', "needs either a column or a topic"),
        ("free = 3\n", "'free' is not a table"),
    ],
)
def test_a_wrong_one_is_refused(folder: Path, text: str, said: str) -> None:
    (folder / "channels.toml").write_text(text)
    with pytest.raises(si.InputError, match=said):
        si.load_campaign(folder)


def test_units_are_those_of_the_table_of_pint_and_none(folder: Path) -> None:
    for unit in ("bar", "%", "K", "1", "L/min"):
        (folder / "channels.toml").write_text(FREE.format(unit))
        assert si.load_campaign(folder).recordings[0].channels["oil_temperature"].unit == unit
