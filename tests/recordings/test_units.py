"""Units of recorded signals: the table of test labs, and Pint for what it does not have."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from savgs_ident.core.errors import InputError
from savgs_ident.recordings.read import read_campaign
from savgs_ident.recordings.recording import ChannelSpec, RecordingLayout
from savgs_ident.recordings.units import UNITS, factor_between, find_unit

LAYOUT = RecordingLayout(
    (
        ChannelSpec("field", "T", "flux density"),
        ChannelSpec("flow", "m^3/s", "flow of the oil"),
        ChannelSpec("torque", "N m", "torque"),
        ChannelSpec("oil", "K", "temperature of the oil"),
        ChannelSpec("accel", "m/s^2", "acceleration"),
    ),
    "torque",
    ("field",),
)
SI_OF = {
    "time": "s", "length": "m", "acceleration": "m/s^2", "angle": "rad", "angular velocity": "rad/s",
    "velocity": "m/s", "angular acceleration": "rad/s^2", "force": "N", "torque": "N m",
    "pressure": "Pa", "mass": "kg", "current": "A", "voltage": "V", "power": "W", "frequency": "Hz",
}  # fmt: skip


@pytest.mark.parametrize(
    ("written", "channel", "factor"),
    [
        ("mT", "field", 1e-3),
        ("uT", "field", 1e-6),
        ("l/min", "flow", 1e-3 / 60.0),
        ("cm³/s", "flow", 1e-6),
        ("ozf in", "torque", 0.028349523125 * 9.80665 * 0.0254),
        ("kN·mm", "torque", 1.0),
        ("g", "accel", 9.80665),
        ("ft/s**2", "accel", 0.3048),
    ],
)
def test_any_unit_is_one_of_its_kind(written: str, channel: str, factor: float) -> None:
    assert LAYOUT.unit_factor(written, channel) == pytest.approx(factor, rel=1e-9)


@pytest.mark.parametrize(
    ("written", "channel"),
    [("mT", "flow"), ("A", "field"), ("degC", "oil"), ("wombat", "torque"), ("s", "accel")],
)
def test_another_kind_and_what_counts_from_elsewhere_are_refused(written: str, channel: str) -> None:
    with pytest.raises(InputError, match="unit"):
        LAYOUT.unit_factor(written, channel)


def test_the_table_says_what_pint_says() -> None:
    """But for what test labs mean otherwise: by g an acceleration."""
    compared = 0
    for name, unit in UNITS.items():
        found = factor_between(name, SI_OF[unit.dimension])
        if found is not None and name not in ("rpm", "rev/min", "1/min") and not name.startswith("grad"):
            assert found == pytest.approx(unit.factor, rel=1e-6), name
            compared += 1
    assert compared > 50


@pytest.mark.parametrize("written", ["deg", "°", "Grad", "grad", "Degrees"])
def test_a_degree_is_one_in_german_too(written: str) -> None:
    """To Pint ``Grad`` are a thousand million radians, and ``grad`` nine tenths of a degree."""
    found, speed = find_unit(written), find_unit(f"{written}/s")
    assert found is not None
    assert (found.factor, found.dimension) == (np.pi / 180.0, "angle")
    assert speed is None or (speed.factor, speed.dimension) == (np.pi / 180.0, "angular velocity")


@given(st.text("mskgNAT0123456789 ^*/().-", max_size=45))
def test_no_text_ends_in_anything_but_a_number_or_nothing(text: str) -> None:
    found = factor_between(text, "m")
    assert found is None or (found > 0.0 and np.isfinite(found))


def test_powers_of_numbers_are_not_computed() -> None:
    for text in ("m*9**9**9**9", "9^9^9^9 m", "m^999999999", "(99)^99^99 m", "m*(9^9)^(9^9)"):
        assert factor_between(text, "m") is None


def test_a_recording_in_such_units_is_read(tmp_path: Path) -> None:
    path = tmp_path / "dwell_2Hz.csv"
    time = np.arange(400) / 100.0
    wave = np.sin(4.0 * np.pi * time)
    rows = "\n".join(f"{t},{200.0 * w},{3.0 * w},{293.15 + w}" for t, w in zip(time, wave, strict=True))
    path.write_text(f"time [s],field [mT],torque [kgf cm],oil [K]\n{rows}\n")
    (recording,) = read_campaign(path, LAYOUT).recordings
    np.testing.assert_allclose(recording.channels["field"].values, 0.2 * wave, atol=1e-12)
    np.testing.assert_allclose(recording.channels["torque"].values, 3.0 * 0.0980665 * wave, atol=1e-9)
    assert find_unit("mT") is None
