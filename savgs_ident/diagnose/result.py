"""The result of a diagnosis, frozen: what reports and later stages read."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.rig import Rig
from savgs_ident.responses.harmonic_response import HarmonicResponse

Kind = Literal["none", "effect", "several", "unknown"]


@dataclass(frozen=True)
class Verdict:
    """What is missing in the model.

    Attributes:
        kind: nothing, one effect, several, or something that the catalogue does not have.
        effects: their names.
        ports: where they act; for an unknown one, the port that explains it best.
        confusable_with: effects that this campaign cannot tell from those named.
        sentence: the verdict in one sentence.
        confusable_ports: of something unknown, ports that this campaign cannot tell from the one named.
        another_law: whether what is named acts by another law than the catalogue's.
    """

    kind: Kind
    effects: tuple[str, ...]
    ports: tuple[str, ...]
    confusable_with: tuple[str, ...]
    sentence: str
    confusable_ports: tuple[str, ...] = ()
    another_law: bool = False


@dataclass(frozen=True)
class PortShare:
    """How much of the recalibrated gap something at a port can carry.

    Attributes:
        port: name of the port.
        share: share of the gap (in squared sd) in tests left out that the law learned from the others explains.
        reach: share that any signal at this port, free in every test, would explain.
    """

    port: str
    share: float
    reach: float


@dataclass(frozen=True)
class MapCell:
    """The gap of one harmonic, recalibrated baseline: in per cent of the channel's response and in noise sd."""

    channel: str
    frequency_hz: float
    order: int
    gap_percent: float
    gap_sigma: float


@dataclass(frozen=True)
class CyclePosition:
    """Where in the cycle of the body's velocity the gap of a channel lies, as shares of its square."""

    channel: str
    reversal: float
    mid_stroke: float
    between: float


@dataclass(frozen=True)
class Estimate:
    """A parameter of an effect with its 95 % interval, SI."""

    name: str
    value: float
    lo: float
    hi: float
    unit: str


@dataclass(frozen=True)
class Learned:
    """A correction for something unknown: a force at a port, fitted on the nonlinear rig.

    Attributes:
        effect: its name as an effect of a model.
        port: name of the port.
        parameters: its coefficients with their 95 % intervals.
        identified: all its numbers, and those of the rig that were fitted beside it, SI, by name.
    """

    effect: str
    port: str
    parameters: tuple[Estimate, ...]
    identified: Mapping[str, float]


@dataclass(frozen=True)
class Candidate:
    """A hypothesis about what is missing.

    Attributes:
        name: "none", "unknown", the effect's name, or two joined by " + ".
        effects: names of its effects; empty for none and unknown.
        probability: its probability, all hypotheses sum to 1.
        score_sigma: significance at the null, nuisances projected out.
        heldout_gain: rise of the log predictive density of left-out tests over the baseline, per datum [nat].
        share_closed: share that it explains of what the recalibrated baseline leaves beyond the noise, all
            tests; NaN where it leaves nothing.
        parameters: those of its effects.
        refitted: whether it was fitted in full, or judged by its score alone.
    """

    name: str
    effects: tuple[str, ...]
    probability: float
    score_sigma: float
    heldout_gain: float
    share_closed: float
    parameters: tuple[Estimate, ...]
    refitted: bool


@dataclass(frozen=True)
class Shrink:
    """Relative rms gap [1] over held-out tests (0.1 is 10 %): before, recalibrated, after, and of the noise alone.

    ``share_closed`` is 1 - (after^2 - floor^2) / (before^2 - floor^2), ``interval`` its 95 % interval by
    resampling the tests.
    """

    before: float
    recalibrated: float
    after: float
    floor: float
    share_closed: float
    interval: tuple[float, float]


@dataclass(frozen=True)
class SweepShrink:
    """The same [1] of the first harmonic along the recorded sweep; NaN where nothing was computed."""

    before: float
    recalibrated: float
    after: float
    floor: float


@dataclass(frozen=True)
class NextTest:
    """A test that would separate effects, with the significance to expect from it."""

    test: str
    separates: tuple[str, str]
    expected_sigma: float


@dataclass(frozen=True)
class NotJudgeable:
    """An effect that this campaign cannot show, and the smallest size of its parameter that it could have shown.

    It is in ``unit``, SI.
    """

    effect: str
    parameter: str
    smallest: float
    unit: str


@dataclass(frozen=True)
class Confusable:
    """Two effects and the cosine between what they do to this campaign, nuisances projected out."""

    effects: tuple[str, str]
    cosine: float


@dataclass(frozen=True)
class ForceLoop:
    """A signal inferred at a port along one test, over one period of n instants, against its conjugate motion.

    Attributes:
        port: name of the port.
        frequency_hz: of the test.
        displacement: [m], (n,).
        velocity: [m/s], (n,).
        inferred: inferred signal [``unit``], (n,).
        law: the named effect's law along the same motion [``unit``], (n,); empty if none is named.
        unit: N for a force, m or rad for what gives way, the channel's unit for a sensor.
    """

    port: str
    frequency_hz: float
    displacement: NDArray[np.float64]
    velocity: NDArray[np.float64]
    inferred: NDArray[np.float64]
    law: NDArray[np.float64]
    unit: str


@dataclass(frozen=True)
class Responses:
    """Harmonics of both response channels, complex, (D, 2, K) each, channels as in RESPONSE_CHANNELS.

    Each is in the unit of its reading.
    """

    before: NDArray[np.complex128]
    recalibrated: NDArray[np.complex128]
    after: NDArray[np.complex128]


@dataclass(frozen=True)
class Diagnosis:
    """A whole diagnosis.

    Attributes:
        model: name of the baseline, "simqc" or "simtr", or the name of the rig file's own.
        effects: names of the effects in the baseline.
        rig: the rig as known before any fit.
        parameters: parameters of the recalibrated baseline, SI, by name.
        identified: parameters of the rig with the named effects, SI, by name.
        verdict: the verdict.
        ports: shares of all ports, largest first.
        map: the gap by channel, frequency and order.
        cycle: where in the cycle it lies.
        candidates: all hypotheses, most probable first.
        shrink: the gap over held-out tests, both channels together.
        by_channel: the same by channel.
        sweep: the gap of the sweep, if one was recorded.
        next_tests: tests that would tell apart what this campaign cannot.
        not_judgeable: effects that this campaign cannot show.
        confusable: pairs of effects that look alike in this campaign.
        loops: inferred signals at the guilty port.
        responses: the three models' responses.
        measured: what they are held against.
        converged: whether every search that the verdict stands on ended well.
        warnings: what a reader must know, a sentence each.
        wall_s: how long it took [s].
        learned: the correction for something unknown, where it is a force and could be fitted.
    """

    model: str
    effects: tuple[str, ...]
    rig: Rig
    parameters: Mapping[str, float]
    identified: Mapping[str, float]
    verdict: Verdict
    ports: tuple[PortShare, ...]
    map: tuple[MapCell, ...]
    cycle: tuple[CyclePosition, ...]
    candidates: tuple[Candidate, ...]
    shrink: Shrink
    by_channel: Mapping[str, Shrink]
    sweep: SweepShrink | None
    next_tests: tuple[NextTest, ...]
    not_judgeable: tuple[NotJudgeable, ...]
    confusable: tuple[Confusable, ...]
    loops: tuple[ForceLoop, ...]
    responses: Responses
    measured: HarmonicResponse
    converged: bool
    warnings: tuple[str, ...]
    wall_s: float
    learned: Learned | None = None
