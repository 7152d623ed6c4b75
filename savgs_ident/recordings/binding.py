"""What a reader of a file format works with: its interface, and the step from signals to channels.

A reader lists the signals that a file offers (columns, fields of topics) as :class:`SignalCandidate` records.
:func:`bind` assigns them to channels: the channel map first, then the usual names. The reader returns a
:class:`Reading`: the tests as they stand in the file, before any check, and its warnings.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from savgs_ident.core.errors import DataWarning, InputError
from savgs_ident.recordings.channels import ChannelMap, ChannelRule
from savgs_ident.recordings.layout import RecordingLayout
from savgs_ident.recordings.recording import Recording

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
        rival = bindings.get(name)
        exact = layout.is_exact(label)
        if rival is not None and rival.exact and not exact:
            continue
        if rival is not None and rival.exact == exact:
            raise ambiguous(name, rival.label, candidate.label, source)
        bindings[name] = _by_name(name, layout, candidate, exact, source, warnings)
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


def _by_name(
    name: str,
    layout: RecordingLayout,
    candidate: SignalCandidate,
    exact: bool,
    source: str,
    warnings: list[DataWarning],
) -> Binding:
    unit = layout.split_header(candidate.text).unit or candidate.unit
    factor = unit_factor_or_si(unit, name, layout, candidate.label, source, warnings)
    return Binding(name, candidate.key, factor, 0.0, candidate.label, exact)
