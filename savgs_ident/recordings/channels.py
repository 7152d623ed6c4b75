"""Which column or topic is which channel: units, usual names, and ``channels.toml`` where the names do not say it.

A unit has a dimension, and a channel accepts one dimension: a deflection in seconds is an error.

>>> unit_factor("mm", "susp_deflection")
0.001
>>> unit_factor("m/s²", "sprung_accel")
1.0

Usual names are recognised, with the unit in the header or without it.

>>> split_header("accel_z (g)")
Header(label='accel_z', unit='g')
>>> split_header("deflection_mm")
Header(label='deflection', unit='mm')
>>> canonical_name("Suspension Deflection")
'susp_deflection'

Everything else is mapped in ``channels.toml``, beside the recordings or given::

    [channels.sprung_accel]
    column = "ACC_3"            # CSV: the header as it is, or without its unit
    unit   = "g"                # overrides the unit in the header
    sign   = -1                 # this accelerometer counts downwards

    [channels.susp_deflection]
    topic  = "/pot"             # MCAP: topic and field
    field  = "data"
    unit   = "mm"
    scale  = 1.02               # calibration: SI = unit * sign * (scale * raw + offset)
    offset = -12.5              # in the unit given, after scale

    [channels.link_angle]
    topic  = "/joint_states"
    field  = "position[single_link]"    # by joint name, or position[0]

    [time]
    column = "clock"            # CSV
    unit   = "ms"
    clock  = "header"           # MCAP: header, log or publish; by default the most regular one is chosen

    [tests]
    column = "condition"        # CSV: the column that names the test
    topic  = "/operator"        # MCAP: the topic that carries "start X" and "end X"

A channel that the map does not mention is still recognised by its usual name.
"""

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite, pi
from pathlib import Path
from types import MappingProxyType

from savgs_ident.core.errors import InputError
from savgs_ident.recordings.recording import CANONICAL_UNITS

STANDARD_GRAVITY = 9.80665
"""Standard acceleration of free fall [m/s^2] (ISO 80000-3)."""


@dataclass(frozen=True)
class Unit:
    """``factor`` turns a number in this unit into SI; ``dimension`` is what it measures."""

    factor: float
    dimension: str


_TABLE: dict[str, dict[str, float]] = {
    "time": {"s": 1.0, "sec": 1.0, "seconds": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0},
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254, "inch": 0.0254, "ft": 0.3048},
    "acceleration": {
        "m/s^2": 1.0, "m/s2": 1.0, "m/s/s": 1.0, "ms^-2": 1.0, "ms-2": 1.0, "mm/s^2": 1e-3, "mm/s2": 1e-3,
        "g": STANDARD_GRAVITY, "g0": STANDARD_GRAVITY, "gn": STANDARD_GRAVITY,
        "mg": 1e-3 * STANDARD_GRAVITY, "gal": 1e-2,
    },
    "angle": {"rad": 1.0, "mrad": 1e-3, "deg": pi / 180, "degree": pi / 180, "degrees": pi / 180,
              "rev": 2 * pi, "turn": 2 * pi},
    "angular velocity": {"rad/s": 1.0, "mrad/s": 1e-3, "deg/s": pi / 180, "degrees/s": pi / 180,
                         "rpm": pi / 30, "rev/min": pi / 30, "1/min": pi / 30, "rev/s": 2 * pi},
    "current": {"A": 1.0, "amp": 1.0, "ampere": 1.0, "mA": 1e-3},
}  # fmt: skip

UNITS: Mapping[str, Unit] = MappingProxyType(
    {name: Unit(factor, dimension) for dimension, row in _TABLE.items() for name, factor in row.items()}
)
"""Every unit that is understood, by its normalised spelling."""

DIMENSIONS: Mapping[str, str] = MappingProxyType(
    {
        "time": "time",
        "road_height": "length",
        "sprung_accel": "acceleration",
        "susp_deflection": "length",
        "link_angle": "angle",
        "link_velocity": "angular velocity",
        "motor_current": "current",
    }
)
"""What each canonical channel measures."""

_SPELLINGS = (
    ("²", "^2"), ("**", "^"), ("⁻¹", "^-1"), ("⁻", "^-"), ("µ", "u"), ("μ", "u"), ("°", "deg"), ("º", "deg"),
    ("·", ""), ("*", ""), ("(", ""), (")", ""), (" ", ""),
)  # fmt: skip


def find_unit(text: str) -> Unit | None:
    """The unit written as ``text``, or None if the table does not have it.

    The spelling is tried as it stands, then in lower case (``MM``, ``Deg``, ``RPM``).
    """
    for written, plain in _SPELLINGS:
        text = text.replace(written, plain)
    return UNITS.get(text) or UNITS.get(text.lower())


def unit_factor(text: str, channel: str, *, source: object = "") -> float:
    """The factor from the unit ``text`` to the SI unit of the canonical ``channel``.

    Raises :class:`InputError` for a unit that is not in the table or measures something else.
    """
    dimension = DIMENSIONS[channel]
    usual = ", ".join(_TABLE[dimension])
    unit = find_unit(text)
    if unit is None:
        raise InputError(
            f"unknown unit '{text}'",
            source=source,
            channel=channel,
            remedy=f"write one of {usual}, or give unit and scale in channels.toml",
        )
    if unit.dimension != dimension:
        raise InputError(
            f"unit '{text}' is {_with_article(unit.dimension)}, the channel is {_with_article(dimension)}",
            source=source,
            channel=channel,
            remedy=f"write one of {usual}, or map the right signal in channels.toml",
        )
    return unit.factor


def _with_article(dimension: str) -> str:
    return f"{'an' if dimension[0] in 'a' else 'a'} {dimension}"


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
"""Usual names of the column with the test's name."""
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


FILE_NAME = "channels.toml"
CLOCKS = ("header", "log", "publish")
_TEXTS = ("column", "topic", "field", "unit")
_NUMBERS = ("scale", "offset", "sign")


@dataclass(frozen=True)
class ChannelRule:
    """How one canonical channel is made: SI = unit * sign * (scale * raw + offset)."""

    channel: str
    column: str | None = None
    topic: str | None = None
    field: str | None = None
    unit: str | None = None
    scale: float = 1.0
    offset: float = 0.0
    sign: float = 1.0


@dataclass(frozen=True)
class ChannelMap:
    """The content of ``channels.toml``; an empty one leaves everything to the usual names."""

    rules: tuple[ChannelRule, ...] = ()
    time_column: str | None = None
    time_unit: str | None = None
    clock: str | None = None
    test_column: str | None = None
    test_topic: str | None = None
    source: str = ""


def read_channel_map(path: Path | str) -> ChannelMap:
    """Read ``channels.toml``; raises :class:`InputError` where it is not as described above."""
    try:
        content = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", source=path, remedy="check the path") from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"is not TOML: {error}", source=path, remedy="mend the line it names") from error
    _only(content, ("channels", "time", "tests"), path, "table")
    time = _table(content, "time", path)
    _only(time, ("column", "unit", "clock"), path, "key of [time]")
    tests = _table(content, "tests", path)
    _only(tests, ("column", "topic"), path, "key of [tests]")
    channels = _table(content, "channels", path)
    clock = _text(time, "clock", path)
    if clock is not None and clock not in CLOCKS:
        raise InputError(f"clock '{clock}' is not known", source=path, remedy="choose " + ", ".join(CLOCKS))
    return ChannelMap(
        rules=tuple(_rule(name, _table(channels, name, path), path) for name in channels),
        time_column=_text(time, "column", path),
        time_unit=_text(time, "unit", path),
        clock=clock,
        test_column=_text(tests, "column", path),
        test_topic=_text(tests, "topic", path),
        source=str(path),
    )


def _rule(name: str, table: dict[str, object], path: Path | str) -> ChannelRule:
    if name not in CANONICAL_UNITS:
        raise InputError(
            f"'{name}' is not a canonical channel", source=path, remedy="use " + ", ".join(CANONICAL_UNITS)
        )
    _only(table, (*_TEXTS, *_NUMBERS), path, f"key of [channels.{name}]")
    texts = {key: _text(table, key, path) for key in _TEXTS}
    if (texts["column"] is None) == (texts["topic"] is None):
        raise InputError(
            "needs either a column or a topic",
            source=path,
            channel=name,
            remedy="give exactly one of the two",
        )
    numbers = {key: _number(table, key, path, name) for key in _NUMBERS if key in table}
    if numbers.get("sign", 1.0) not in (1.0, -1.0):
        raise InputError("sign is neither 1 nor -1", source=path, channel=name, remedy="use scale for a gain")
    return ChannelRule(
        channel=name,
        column=texts["column"],
        topic=texts["topic"],
        field=texts["field"],
        unit=texts["unit"],
        scale=numbers.get("scale", 1.0),
        offset=numbers.get("offset", 0.0),
        sign=numbers.get("sign", 1.0),
    )


def _only(table: dict[str, object], allowed: tuple[str, ...], path: Path | str, what: str) -> None:
    unknown = sorted(set(table) - set(allowed))
    if unknown:
        raise InputError(f"unknown {what} '{unknown[0]}'", source=path, remedy="use " + ", ".join(allowed))


def _table(content: dict[str, object], name: str, path: Path | str) -> dict[str, object]:
    table = content.get(name, {})
    if not isinstance(table, dict):
        raise InputError(
            f"'{name}' is not a table", source=path, remedy="see the example in the documentation"
        )
    return table


def _text(table: dict[str, object], key: str, path: Path | str) -> str | None:
    value = table.get(key)
    if value is not None and not isinstance(value, str):
        raise InputError(f"'{key}' is not a text", source=path, remedy="put it in quotes")
    return value


def _number(table: dict[str, object], key: str, path: Path | str, channel: str) -> float:
    value = table[key]
    wrong = InputError(f"'{key}' is not a finite number", source=path, channel=channel, remedy="mend it")
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise wrong
    try:
        number = float(value)
    except OverflowError:
        raise wrong from None
    if not isfinite(number):
        raise wrong
    return number
