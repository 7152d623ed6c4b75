"""Whether what was read is sound: every number in it finite, a campaign's channels in order and in SI.

A bound of a parameter may be infinite: it says that there is none.
"""

from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from math import isfinite

import control
import numpy as np

from savgs_ident.core.parameter import Parameter
from savgs_ident.recordings.recording import Campaign, Recording, RecordingLayout

_BOUNDS = ("lower", "upper")


def unsound(found: object) -> str:
    """Where ``found`` is not sound, in words; empty if it is."""
    return next(_faults(found, "what was read"), "")


def _faults(found: object, where: str) -> Iterator[str]:
    if isinstance(found, Campaign):
        yield from _campaign_faults(found)
    elif isinstance(found, Mapping):
        for name, each in found.items():
            yield from _faults(each, f"{where}[{name!r:.40}]")
    elif isinstance(found, list | tuple | set | frozenset):
        for place, each in enumerate(found):
            yield from _faults(each, f"{where}[{place}]")
    elif isinstance(found, control.StateSpace):
        yield from _faults([found.A, found.B, found.C, found.D, found.dt], where)
    elif is_dataclass(found):
        for each in fields(found):
            if not (isinstance(found, Parameter) and each.name in _BOUNDS):
                yield from _faults(getattr(found, each.name), f"{where}.{each.name}")
    else:
        yield from _number_faults(found, where)


def _number_faults(found: object, where: str) -> Iterator[str]:
    if isinstance(found, float) and not isfinite(found):
        yield f"{where} is {found}"
    elif hasattr(found, "__array__"):
        array = np.asarray(found)
        if array.dtype.kind in "fc" and not np.isfinite(array).all():
            yield f"{where} has numbers that are not finite"


def _campaign_faults(campaign: Campaign) -> Iterator[str]:
    if not campaign.recordings:
        yield "the campaign has no recording"
    for recording in campaign.recordings:
        yield from _recording_faults(recording, campaign.layout)


def _recording_faults(recording: Recording, layout: RecordingLayout) -> Iterator[str]:
    frequency = recording.frequency_hz
    if frequency is not None and not 0.0 < frequency < np.inf:
        yield f"the frequency of '{recording.name}' is {frequency}"
    for name, channel in recording.channels.items():
        if channel.unit != layout.si_unit(name):
            yield f"'{name}' is in {channel.unit}"
        if channel.time.shape != channel.values.shape:
            yield f"'{name}' has {channel.values.size} values at {channel.time.size} times"
        elif not (np.isfinite(channel.values).all() and np.isfinite(channel.time).all()):
            yield f"'{name}' has numbers that are not finite"
        elif not (np.diff(channel.time) > 0.0).all():
            yield f"the time of '{name}' does not increase"
