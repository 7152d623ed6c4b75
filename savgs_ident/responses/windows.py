"""Tests that do not repeat, as a road or a sweep, cut into windows that a periodic solution follows.

    response = estimate_windows(campaign, inputs=("road_height",), readings=("sprung_accel", "susp_deflection"))

A rig forgets how a motion began. So each window begins some seconds before what is compared of it (:data:`LEAD_S`,
more for a plant that rings), and at its end its inputs are led over, in :data:`CLOSING_S`, to what they were before
it began. In such a window the inputs repeat, and the periodic motion that they lead to is the recorded one in what is
compared, wherever the recorded one came from: no state at the beginning has to be estimated. A test that
begins at rest is compared from its beginning, for before it the rig rested: there the state is known.

Some tests do not last until their beginning is forgotten: those of a rig that forgets nothing, as one that sticks
from step to step, short ones, and those in which the rig is released and left alone, where all that there is to see
is how it forgets. Each of them is one window, from its beginning (:func:`estimate_whole_tests`); where it does not
begin at rest, the state with which it begins is estimated (:mod:`savgs_ident.inference.initial_states`).

What is compared are complex amplitudes of the readings, weighted in time by a share that is zero outside that part
(:func:`savgs_ident.responses.harmonic_response.compared_share`), recorded and predicted alike:

    X_k = 2 / N sum_n m(t_n) x(t_n) exp(-2 pi i k t_n / T).

Noise of one sample, of variance s^2, has in each part of them the variance 2 s^2 / N^2 sum_n m(t_n)^2. Neighbours
share what they see of it, for the part that is compared is shorter than the window: every second is compared at most,
and every so many-th where there would be more than :data:`NUMBERS`.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from math import ceil, floor, log

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning, InputError
from savgs_ident.recordings.recording import Campaign, Recording, TestKind
from savgs_ident.responses.even_record import LEAST_SAMPLES, EvenRecord, even_record, is_decay
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.responses.outliers import estimate_standstill_noise
from savgs_ident.responses.selection import only_tests
from savgs_ident.responses.window_amplitudes import CLOSING_S, HIGHEST_HZ, IMPOSED_HZ, LOWEST_HZ, Cut, Windows

Array = NDArray[np.float64]

KINDS: tuple[TestKind, ...] = ("road", "sweep", "step", "decay", "other")
"""The kinds of test that are cut into windows."""

BESIDE_DWELLS: tuple[TestKind, ...] = ("road", "step", "decay")
"""Those of them that are where there are dwells: there a sweep is kept to see what is predicted of it."""

LEAD_S = 3.0
"""From the beginning of a window to what is compared of it [s]; times are those of a plant whose time scale is 1.

Origin: the body of a quarter car, at 1.3 Hz with a fifth of critical damping, has kept 0.7 % of what it began with,
the wheel nothing; friction shortens both.
"""

COMPARED = 3.0
"""About how much of each window is compared, over its lead. Origin: computing time; more wastes less on the lead."""

LEAST_S = 2.0
"""Less than this is not worth a window [s]."""

SAMPLES = 4.0
"""Samples in a period of the highest frequency that is compared, where nothing else is asked for."""

MOST_HZ = 0.5 * IMPOSED_HZ
"""Up to this may be compared [Hz]: what the readings show there has to come from inputs that are imposed."""

WHOLE_S = 60.0
"""So much of a test is compared as one window at most [s]. Origin: computing time."""

_NEAR = 1.5


def estimate_windows(
    campaign: Campaign,
    inputs: Sequence[str],
    readings: Sequence[str],
    highest_hz: float | None = None,
    lead_s: float | None = None,
    kinds: Collection[TestKind] = KINDS,
    time_scale: float = 1.0,
) -> HarmonicResponse:
    """The response of all tests of ``campaign`` of these ``kinds``, which do not repeat, in windows.

    ``inputs`` are the channels that drive the plant, the first of which has to move; ``readings`` are what its
    sensors read. The noise is that of the standstill; where none was recorded, it is read from how rough the channels
    are. Up to ``highest_hz`` is compared [Hz], from ``lead_s`` [s] after the beginning of each window on; where they
    are left out, up to :data:`HIGHEST_HZ`, or as far as the channels are sampled, and from :data:`LEAD_S` on, for a
    plant with a ``time_scale`` [1].

    Raises :class:`InputError` where no test is long enough, the first input does not move, or nothing is compared.
    """
    tests = _Tests.of(campaign, inputs, readings, highest_hz, kinds, time_scale)
    lead = LEAD_S * time_scale if lead_s is None else lead_s
    first, driven = lead + tests.closing, [each for each in tests.records if not each.decays]
    if tests.need_no_cut(driven, COMPARED * lead * _NEAR):
        return _whole(tests)
    found = [each.rested(first) if each.begins_at_rest else each for each in driven]
    compared = _compared_s([each.duration - first for each in found], COMPARED * lead, tests.least)
    if compared == 0.0:
        return _whole(tests)
    cut = [Cut(each, end, compared, lead) for each in found for end in _ends(each.duration, first, compared)]
    short = [each for each in found if each.duration - first < compared]
    decays = [each for each in tests.records if each.decays]
    cut += [_from_its_beginning(each, lead + compared, lead) for each in (*short, *decays)]
    return tests.response(cut, _all_shortened(campaign.source, decays, lead + compared))


def estimate_whole_tests(
    campaign: Campaign,
    inputs: Sequence[str],
    readings: Sequence[str],
    highest_hz: float | None = None,
    kinds: Collection[TestKind] = KINDS,
    time_scale: float = 1.0,
) -> HarmonicResponse:
    """The same of all tests from their beginning to their end.

    For a plant that forgets nothing. One that begins at rest is one window, of which :data:`WHOLE_S` are compared at
    most; another is cut into pieces without a lead, each of which begins with a state that is to be estimated. Over a
    few seconds a model that is a few per cent off stays in step with what was recorded; over a minute it does not.
    """
    return _whole(_Tests.of(campaign, inputs, readings, highest_hz, kinds, time_scale))


def _whole(tests: "_Tests") -> HarmonicResponse:
    if not tests.records:
        raise _no_test(tests.campaign, tests.warnings)
    lead, longest = LEAD_S * tests.time_scale, WHOLE_S * tests.time_scale
    rested = [each.rested(lead + tests.closing) for each in tests.records if each.begins_at_rest]
    moving = [each for each in tests.records if not each.begins_at_rest]
    cut = [_from_its_beginning(each, longest, lead) for each in rested]
    cut += [piece for each in moving for piece in _pieces(each, COMPARED * lead)]
    return tests.response(cut, _all_shortened(tests.campaign.source, rested, longest))


def _pieces(record: EvenRecord, wanted: float) -> list[Cut]:
    """A record that begins moving, in pieces of about so much [s], each of which begins with a state of its own."""
    length = record.duration / max(1, round(record.duration / wanted))
    ends = _ends(record.duration, 0.0, length)
    return [Cut(record, end, length, 0.0) for end in ends]


def _from_its_beginning(record: EvenRecord, longest: float, lead: float) -> Cut:
    """A record from its beginning on, so much of it at most [s]; where there was rest before it, after a lead [s]."""
    compared = min(record.duration - record.before, longest)
    return Cut(record, record.before + compared, compared, lead if record.before else 0.0)


@dataclass(frozen=True)
class _Tests:
    """Tests of a campaign that can be used, in inputs and readings, up to a frequency [Hz]; times are in [s]."""

    campaign: Campaign
    inputs: Sequence[str]
    readings: Sequence[str]
    highest_hz: float
    time_scale: float
    still: Mapping[str, float]
    records: tuple[EvenRecord, ...]
    warnings: tuple[DataWarning, ...]

    @classmethod
    def of(
        cls,
        campaign: Campaign,
        inputs: Sequence[str],
        readings: Sequence[str],
        wanted_hz: float | None,
        kinds: Collection[TestKind],
        time_scale: float,
    ) -> "_Tests":
        """Those of some kinds. Raises :class:`InputError` for a frequency up to which nothing can be compared."""
        tests = [each for each in campaign.recordings if each.kind in kinds]
        names = (*inputs, *readings)
        least, most = 2.0 * LOWEST_HZ / time_scale, MOST_HZ / time_scale
        usual = HIGHEST_HZ / time_scale
        highest = _as_sampled(tests, inputs, names, usual) if wanted_hz is None else wanted_hz
        if not least <= highest <= most:
            raise InputError(
                f"windows cannot be compared up to {highest:g} Hz",
                source="--max-frequency",
                remedy=f"choose it from {least:g} to {most:g} Hz",
            )
        still, warnings = estimate_standstill_noise(campaign)
        found = [
            even_record(
                campaign.source, each, inputs, names, still, LEAST_S * time_scale, highest, time_scale
            )
            for each in tests
        ]
        refused = tuple(each for each in found if isinstance(each, DataWarning))
        records = tuple(each for each in found if isinstance(each, EvenRecord))
        told = (*warnings, *refused)
        if wanted_hz is None and highest < usual:
            told += (_compared_less(campaign.source, highest, usual),)
        return cls(campaign, inputs, readings, highest, time_scale, still, records, told)

    @property
    def closing(self) -> float:
        """In so long inputs are led over to where a window began."""
        return CLOSING_S * self.time_scale

    @property
    def least(self) -> float:
        """Less than this is not worth a window."""
        return LEAST_S * self.time_scale

    def need_no_cut(self, driven: Sequence[EvenRecord], longest_s: float) -> bool:
        """Whether each of those that are ``driven`` begins at rest and is no longer than a window may be [s]."""
        return all(each.begins_at_rest and self.least <= each.duration <= longest_s for each in driven)

    def response(self, cut: Sequence[Cut], warnings: Sequence[DataWarning] = ()) -> HarmonicResponse:
        """What is compared in windows, with further warnings."""
        here = [each.record for each in cut]
        assumed = [
            name
            for name in self.readings
            if name not in self.still and any(name in each.values for each in here)
        ]
        told = (*self.warnings, *warnings)
        if assumed:
            told += (_noise_assumed(self.campaign.source, assumed),)
        windows = Windows.of(cut, self.time_scale)
        names = (*self.inputs, *self.readings)
        # The inputs of a decay need not be recorded.
        alone = any(each.decays for each in here)
        channels = tuple(
            name
            for name in names
            if any(name in each.values for each in here) or (alone and name == self.inputs[0])
        )
        response = replace(
            windows.response(channels, set(self.inputs), told, self.highest_hz),
            recorded=windows.recorded(self.campaign),
            beside=windows.beside(self.campaign),
        )
        return _with_readings(self.campaign.source, response, self.readings)


def _as_sampled(
    tests: Sequence[Recording], inputs: Sequence[str], names: Sequence[str], usual: float
) -> float:
    """Up to which frequency is compared [Hz]: the usual one, or as far as the slowest channel is sampled.

    A channel that is sampled too slowly for a third of the usual is refused later, with what to do.
    """
    rates = [
        each.channels[name].rate_hz
        for each in tests
        for name in (names if not is_decay(each, inputs) else [one for one in names if one not in inputs])
        if name in each.channels
    ]
    slowest = min(rates, default=LEAST_SAMPLES * usual)
    fits = slowest >= LEAST_SAMPLES * usual or slowest < SAMPLES * usual / 3.0
    return usual if fits else slowest / SAMPLES


def _compared_less(source: str, highest: float, usual: float) -> DataWarning:
    return DataWarning(
        "compared_less",
        f"is compared up to {highest:.3g} Hz in place of {usual:.3g} Hz, as far as the slowest channel is sampled",
        source,
        remedy=f"sample every channel at {SAMPLES * usual:.3g} Hz or faster",
    )


def _with_readings(source: str, response: HarmonicResponse, readings: Sequence[str]) -> HarmonicResponse:
    """The windows in which any reading is known all along, with a warning for each of the others."""
    places = [response.channel(name) for name in readings if name in response.channels]
    known = response.valid[:, places].any(axis=(1, 2))
    names, remedy = " or ".join(readings), "look at the sensors and their recording"
    if not known.any():
        raise InputError(f"no window has {names} without a gap", source=source, remedy=remedy)
    warnings = tuple(
        DataWarning(
            "window_not_used", f"has no {names} without a gap", source, response.tests[d], remedy=remedy
        )
        for d in np.flatnonzero(~known)
    )
    if not warnings:
        return response
    return replace(only_tests(response, np.flatnonzero(known)), warnings=(*response.warnings, *warnings))


def _compared_s(lasting: Sequence[float], wanted: float, worth_it: float) -> float:
    """How much of every window is compared [s], where tests have so much that can be [s]; 0 where none is worth it.

    Windows are of one length. It is one near ``wanted`` that leaves least uncompared, of several such the nearest;
    where all tests are shorter, of theirs.
    """
    longest = max(lasting, default=0.0)
    if longest < worth_it:
        return 0.0
    least = max(min(wanted / _NEAR, longest), worth_it)
    lengths = {
        each / count
        for each in lasting
        for count in range(1, ceil(each / least) + 1)
        if each >= count * least
    }
    near = [each for each in lengths if each <= wanted * _NEAR] or [min(lengths)]

    def worth(each: float) -> tuple[float, float]:
        return round(sum(each * _count(one, each) for one in lasting), 6), -abs(log(each / wanted))

    return max(near, key=worth)


def _count(lasting: float, compared: float) -> int:
    return floor(lasting / compared + 1e-9)


def _ends(duration: float, first: float, compared: float) -> list[float]:
    """Where what is compared in each window of a test ends [s after its beginning]."""
    return [duration - place * compared for place in reversed(range(_count(duration - first, compared)))]


def _all_shortened(source: str, records: Sequence[EvenRecord], longest: float) -> list[DataWarning]:
    """Warnings about tests of which no more than the first seconds are compared [s]."""
    what = f"is compared in its first {longest:.3g} s only"
    return [
        _not_used(source, each, what, "cut it into several tests, if what comes later matters")
        for each in records
        if each.duration - each.before > longest
    ]


def _not_used(source: str, even: EvenRecord, what: str, remedy: str) -> DataWarning:
    return DataWarning("window_not_used", what, source, even.test, remedy=remedy)


def _no_test(campaign: Campaign, warnings: tuple[DataWarning, ...]) -> InputError:
    warnings = (*warnings, *campaign.left_out)
    if not warnings:
        return InputError(
            "there is no test to compare with: neither a dwell nor a sweep or a road",
            source=campaign.source,
            remedy="name the dwells dwell_<f>Hz; a test with another name is taken as it is",
        )
    first = warnings[0]
    return InputError(
        f"no test can be used; the first: {first.what}",
        source=campaign.source,
        test=first.test,
        channel=first.channel,
        remedy=first.remedy,
    )


def _noise_assumed(source: str, names: Sequence[str]) -> DataWarning:
    return DataWarning(
        "noise_assumed",
        f"no standstill was recorded: the noise of {', '.join(names)} is read from how rough they are",
        source,
        "",
        names[0],
        None,
        "record some seconds at rest, and name that test standstill",
    )
