"""Which signal of a file is which channel: by ``channels.toml``, or by its usual name.

A reader of a file format lists the signals that a file offers (columns, fields of topics) as
:class:`SignalCandidate` records. :func:`bind` assigns them to channels: by the channel map first, then by their
usual names. The reader returns a :class:`Reading`: the tests as they stand in the file, before any check, and its
warnings.

The channel map is the file ``channels.toml``, beside the recordings or given. It says which column or topic is which
channel where the names do not say it::

    [channels.link_velocity]
    column = "SPEED_3"          # CSV: the header as it is, or without its unit
    unit   = "rpm"               # overrides the unit in the header
    sign   = -1                 # this sensor counts downwards

    [channels.susp_deflection]
    topic  = "/pot"             # MCAP: topic and field
    field  = "data"
    unit   = "mm"
    scale  = 1.02               # calibration: SI = unit * sign * (scale * raw + offset)
    offset = -12.5              # in the unit given, after scale

    [channels.road_height]      # no column, no topic: of the signal that has the usual name
    unit   = "mm"

    [channels.link_angle]
    topic  = "/joint_states"
    field  = "position[single_link]"    # by joint name, or position[0]

    [free.oil_temperature]      # none of the plant's: any name that the plant has no channel of
    column = "T_oil"
    unit   = "degC"             # of the values, as they stand; any that there is, "1" for a number

    [time]
    column = "clock"            # CSV
    unit   = "ms"
    clock  = "header"           # MCAP: header, log or publish; by default the most regular one is chosen

    [tests]
    column = "condition"        # CSV: the column that names the test
    topic  = "/operator"        # MCAP: the topic that carries "start X" and "end X"
"""

import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import isfinite
from pathlib import Path

from savgs_ident.core.errors import DataWarning, InputError
from savgs_ident.recordings.recording import ChannelSpec, Recording, RecordingLayout, normalise
from savgs_ident.recordings.units import is_unit

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
    """The content of ``channels.toml`` for a layout; an empty one leaves everything to the usual names.

    ``rules`` name a column or a topic; those in ``of_usual_names`` say unit, gain or sign of what is found without.
    """

    layout: RecordingLayout
    rules: tuple[ChannelRule, ...] = ()
    of_usual_names: tuple[ChannelRule, ...] = ()
    time_column: str | None = None
    time_unit: str | None = None
    clock: str | None = None
    test_column: str | None = None
    test_topic: str | None = None
    source: str = ""


def read_channel_map(path: Path | str, layout: RecordingLayout) -> ChannelMap:
    """Read ``channels.toml``; raises :class:`InputError` where it is not as described above."""
    try:
        content = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", source=path, remedy="check the path") from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"is not TOML: {error}", source=path, remedy="mend the line it names") from error
    _only(content, ("channels", "free", "time", "tests"), path, "table")
    time = _table(content, "time", path)
    _only(time, ("column", "unit", "clock"), path, "key of [time]")
    tests = _table(content, "tests", path)
    _only(tests, ("column", "topic"), path, "key of [tests]")
    channels, beside = _table(content, "channels", path), _table(content, "free", path)
    free = {name: _table(beside, name, path) for name in beside}
    every = tuple(_free_channel(name, layout, table, path) for name, table in free.items())
    extended = replace(layout, channels=(*layout.channels, *every))
    clock = _text(time, "clock", path)
    if clock is not None and clock not in CLOCKS:
        raise InputError(f"clock '{clock}' is not known", source=path, remedy="choose " + ", ".join(CLOCKS))
    rules = [_rule(name, layout, _table(channels, name, path), path) for name in channels]
    rules += [_free_rule(name, extended, table, path) for name, table in free.items()]
    return ChannelMap(
        extended,
        rules=tuple(each for each in rules if each.column or each.topic),
        of_usual_names=tuple(each for each in rules if not each.column and not each.topic),
        time_column=_text(time, "column", path),
        time_unit=_text(time, "unit", path),
        clock=clock,
        test_column=_text(tests, "column", path),
        test_topic=_text(tests, "topic", path),
        source=str(path),
    )


def _free_channel(
    name: str, layout: RecordingLayout, table: dict[str, object], path: Path | str
) -> ChannelSpec:
    if layout.canonical_name(name) is not None or normalise(name) != name:
        raise InputError(
            f"'{name}' is the plant's own, or has more than small letters, digits and underscores",
            source=path,
            channel=name,
            remedy="give it another name, or map it under [channels]",
        )
    unit = _text(table, "unit", path)
    if unit is None or not (unit == "1" or is_unit(unit)):
        raise InputError(
            "has no unit" if unit is None else f"unknown unit '{unit}'",
            source=path,
            channel=name,
            remedy='write one, as unit = "degC", or unit = "1" for a number',
        )
    return ChannelSpec(name, unit, "recorded beside", free=True)


def _free_rule(name: str, layout: RecordingLayout, table: dict[str, object], path: Path | str) -> ChannelRule:
    found = _rule(name, layout, table, path)
    if not found.column and not found.topic:
        raise InputError(
            "needs either a column or a topic",
            source=path,
            channel=name,
            remedy="give exactly one of the two",
        )
    return found


def _rule(name: str, layout: RecordingLayout, table: dict[str, object], path: Path | str) -> ChannelRule:
    if name not in layout.names:
        raise InputError(
            f"'{name}' is not a known channel", source=path, remedy="use " + ", ".join(layout.names)
        )
    _only(table, (*_TEXTS, *_NUMBERS), path, f"key of [channels.{name}]")
    texts = {key: _text(table, key, path) for key in _TEXTS}
    if texts["field"] is not None and not texts["topic"]:
        raise InputError(
            "names a field and no topic",
            source=path,
            channel=name,
            remedy="name the topic that has the field",
        )
    if "" in (texts["column"], texts["topic"]) or (texts["column"] and texts["topic"]) or not table:
        raise InputError(
            "names a column and a topic" if texts["column"] and texts["topic"] else "says nothing",
            source=path,
            channel=name,
            remedy="give a column or a topic, or unit, scale, offset or sign of the signal with the usual name",
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


class AbsentSignalError(InputError):
    """A column or a topic that a map names and a file does not have."""


Progress = Callable[[float], None]
"""Called with the share of the source that has been read, 0 to 1."""


@dataclass(frozen=True)
class Reading:
    """Unchecked recordings (missing samples are NaN) and the reader's own warnings."""

    recordings: tuple[Recording, ...]
    warnings: tuple[DataWarning, ...]


@dataclass(frozen=True)
class Reader:
    """One file format: its suffixes, the bytes it may begin with (none: plain text), and how it is read."""

    name: str
    suffixes: tuple[str, ...]
    magic: tuple[bytes, ...]
    plain_text: bool
    read: Callable[[Path, ChannelMap, Progress], Reading]


@dataclass(frozen=True)
class SignalCandidate:
    """A signal in a file.

    ``key`` is how the reader finds it, ``text`` its header or field name (a unit may be written there),
    ``unit`` one that is known from elsewhere (a schema, a convention), ``label`` its name in messages.
    """

    key: str
    text: str
    unit: str | None
    label: str


@dataclass(frozen=True)
class Binding:
    """A channel made of one signal: SI = gain * raw + bias.

    ``exact``: recognised by the canonical name or the map, not by a usual variant.
    """

    channel: str
    key: str
    gain: float
    bias: float
    label: str
    exact: bool


def bind(
    candidates: Sequence[SignalCandidate],
    rules: Sequence[tuple[ChannelRule, str]],
    channel_map: ChannelMap,
    source: str,
) -> tuple[tuple[Binding, ...], tuple[DataWarning, ...]]:
    """Bind signals to channels; ``rules`` pairs each rule of the map with the key of its signal.

    Usual names are ignored for the channels that ``channel_map`` assigns, here or elsewhere.
    Raises :class:`InputError` for an unknown unit or two signals that look alike.
    """
    layout = channel_map.layout
    mapped = {rule.channel for rule in channel_map.rules}
    usual = {rule.channel: rule for rule in channel_map.of_usual_names}
    by_key = {candidate.key: candidate for candidate in candidates}
    bindings: dict[str, Binding] = {}
    warnings: list[DataWarning] = []
    for rule, key in rules:
        bindings[rule.channel] = _by_rule(rule, layout, by_key[key], source, warnings)
    for candidate in candidates:
        label = layout.split_header(candidate.text).label
        name = layout.canonical_name(label)
        if name is None or name == "time" or name in mapped:
            continue
        earlier = bindings.get(name)
        exact = layout.is_exact(label)
        if earlier is not None and earlier.exact and not exact:
            continue
        if earlier is not None and earlier.exact == exact:
            raise ambiguous(name, earlier.label, candidate.label, source)
        rule = usual.get(name, ChannelRule(name))
        bindings[name] = replace(_by_rule(rule, layout, candidate, source, warnings), exact=exact)
    return tuple(bindings.values()), tuple(warnings)


def ambiguous(channel: str, one: str, other: str, source: str) -> InputError:
    """The error for two signals that could both be ``channel``."""
    return InputError(
        f"'{one}' and '{other}' could both be it",
        source=source,
        channel=channel,
        remedy=f"name one under [channels.{channel}] in channels.toml",
    )


def unit_factor_or_si(
    unit: str | None,
    channel: str,
    layout: RecordingLayout,
    label: str,
    source: str,
    warnings: list[DataWarning],
) -> float:
    """The factor of a unit [SI per unit], or 1 with a warning where none is written."""
    if unit:
        return layout.unit_factor(unit, channel, source=source)
    si = layout.si_unit(channel)
    warnings.append(
        DataWarning(
            "unit_assumed",
            f"'{label}' has no unit, taken as {si}",
            source=source,
            channel=channel,
            remedy=f"write it as '{label} [{si}]' or give the unit in channels.toml",
        )
    )
    return 1.0


def _by_rule(
    rule: ChannelRule,
    layout: RecordingLayout,
    candidate: SignalCandidate,
    source: str,
    warnings: list[DataWarning],
) -> Binding:
    unit = rule.unit or layout.split_header(candidate.text).unit or candidate.unit
    factor = unit_factor_or_si(unit, rule.channel, layout, candidate.label, source, warnings) * rule.sign
    return Binding(
        rule.channel, candidate.key, factor * rule.scale, factor * rule.offset, candidate.label, exact=True
    )
