"""Names under which laboratories log the canonical channels, and headers that carry a unit.

>>> split_header("accel_z (g)")
Header(label='accel_z', unit='g')
>>> split_header("deflection_mm")
Header(label='deflection', unit='mm')
>>> canonical_name("Suspension Deflection")
'susp_deflection'
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from savgs_ident.recordings.recording import CANONICAL_UNITS
from savgs_ident.recordings.units import find_unit

ALIASES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "time": ("time", "t", "timestamp", "time_stamp", "elapsed", "elapsed_time"),
        "road_height": (
            "road_height", "road", "road_z", "road_displacement", "road_profile", "cam_height",
            "plate_height", "z_r", "zr",
        ),
        "sprung_accel": (
            "sprung_accel", "sprung_acceleration", "sprung_mass_accel", "sprung_mass_acceleration",
            "body_accel", "body_acceleration", "accel_z", "acc_z", "acceleration_z", "az", "z_s_ddot",
        ),
        "susp_deflection": (
            "susp_deflection", "suspension_deflection", "susp_defl", "deflection", "l_s",
        ),
        "link_angle": ("link_angle", "single_link_angle", "sl_angle", "theta_sl", "dtheta_sl"),
        "link_velocity": ("link_velocity", "link_speed", "single_link_velocity", "sl_velocity"),
        "motor_current": ("motor_current", "current", "i_q", "iq", "motor_current_q"),
    }
)  # fmt: skip
"""Usual names of each channel, normalised; the first one is canonical. The sign conventions are the
canonical ones (up positive, bump positive): a channel that differs is mapped with ``sign = -1``."""

TEST_COLUMNS = ("test", "test_name", "run", "condition")
"""Column names that say which test a row belongs to."""

_BRACKETED = re.compile(r"^(?P<label>.*?)\s*[\[(](?P<unit>[^\[\]()]*)[\])]\s*$")
_BY_ALIAS = {alias: name for name, aliases in ALIASES.items() for alias in aliases}


@dataclass(frozen=True)
class Header:
    """A column header or field name: its label, and its unit where one is written."""

    label: str
    unit: str | None


def normalise(label: str) -> str:
    """Lower case, words joined by underscores, camelCase split."""
    words = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", label.strip())
    return re.sub(r"[^a-z0-9]+", "_", words.lower()).strip("_")


def canonical_name(label: str) -> str | None:
    """The canonical channel (or ``time``) that ``label`` usually stands for, or None."""
    return _BY_ALIAS.get(normalise(label))


def is_exact(label: str) -> bool:
    """Whether ``label`` is a canonical name itself, not one of its usual variants."""
    return normalise(label) in CANONICAL_UNITS


def split_header(text: str) -> Header:
    """Label and unit of ``name [unit]``, ``name (unit)`` or ``name_unit``."""
    text = text.strip()
    match = _BRACKETED.match(text)
    if match and match["label"]:
        return Header(match["label"].strip(), match["unit"].strip())
    label, _, tail = text.rpartition("_")
    if label and canonical_name(text) is None and canonical_name(label) and find_unit(tail):
        return Header(label, tail)
    return Header(text, None)
