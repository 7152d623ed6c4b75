"""The result of a diagnosis, frozen: what reports and later stages read; and the settings of one.

A hypothesis is an object, a key of mappings; its text is for reports and files:

>>> pair = Hypothesis(("rail_stribeck", "accel_lag"))
>>> str(pair), str(NONE), str(UNKNOWN)
('rail_stribeck + accel_lag', 'none', 'unknown')
>>> pair == Hypothesis(("accel_lag", "rail_stribeck"))
True
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import nan
from typing import ClassVar, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.presentation import Result
from savgs_ident.diagnosis.gap import CyclePosition, FurtherShrink, MapCell, Shrink
from savgs_ident.diagnosis.thresholds import DEFAULTS, DecisionConstants
from savgs_ident.effects.base import Family
from savgs_ident.plants.model import Model
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.responses.selection import only_tests
from savgs_ident.simulate.periodic import PeriodicSettings

Kind = Literal["none", "effect", "several", "unknown"]


class PortFamily(NamedTuple):
    """What kind of thing acts where: a location and a family of laws; as text port/family."""

    port: str
    family: Family

    def __str__(self) -> str:
        return f"{self.port}/{self.family.value}"


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """What is missing in a baseline: effects of the catalogue, or something that the catalogue does not have.

    Hypotheses of the same effects are equal, in whatever order these are given.

    Attributes:
        effects: names of the effects; none of them if nothing is missing.
        unknown: whether it is something else. Then there are no effects.
        flexible: port and family of a learned law; None where there is none. Then there are no effects either.
    """

    effects: tuple[str, ...] = ()
    unknown: bool = False
    flexible: PortFamily | None = None

    def __eq__(self, other: object) -> bool:
        """Whether the other one has the same effects."""
        return isinstance(other, Hypothesis) and self._key == other._key

    def __hash__(self) -> int:
        """Of what is compared."""
        return hash(self._key)

    def __str__(self) -> str:
        """The effects joined by plus signs, a port/family, "none" or "unknown"."""
        if self.unknown:
            return "unknown"
        return str(self.flexible) if self.flexible else " + ".join(self.effects) or "none"

    def with_effect(self, name: str) -> Self:
        """The hypothesis with one more effect."""
        return type(self)((*self.effects, name))

    @property
    def _key(self) -> tuple[frozenset[str], bool, PortFamily | None]:
        return frozenset(self.effects), self.unknown, self.flexible


NONE = Hypothesis()
"""Nothing is missing."""

UNKNOWN = Hypothesis(unknown=True)
"""Something is missing that the catalogue does not have."""


@dataclass(frozen=True)
class Verdict:
    """What is missing in the model.

    Attributes:
        kind: nothing, one effect, several, or something that the catalogue does not have.
        effects: their names.
        ports: where they act; for an unknown one, the port that explains it best.
        confusable_with: effects that this campaign cannot distinguish from those named.
        sentence: the verdict in one sentence.
        confusable_ports: ports that this campaign cannot distinguish from the one named: where the effects of
            ``confusable_with`` act, and where a law of another form would do as much.
        families: the kinds of what is missing, each with its port.
        law_known: whether what is named acts by the law of the catalogue; otherwise that is the nearest.
        probability: of what is said, all hypotheses summing to 1.
    """

    kind: Kind
    effects: tuple[str, ...]
    ports: tuple[str, ...]
    confusable_with: tuple[str, ...]
    sentence: str
    confusable_ports: tuple[str, ...] = ()
    families: tuple[PortFamily, ...] = ()
    law_known: bool = True
    probability: float = 1.0

    def __str__(self) -> str:
        return self.sentence


@dataclass(frozen=True)
class PortShare:
    """How much of the recalibrated gap something at a port explains.

    Attributes:
        port: name of the port.
        share: share of the gap (in squared sd) in tests left out that the law learned from the others explains.
        free_input_share: share that any input at this port, free in every dwell, would explain of the gap there.
        probability: of what acts there, over all hypotheses; effects of a pair count at the port of each.
    """

    port: str
    share: float
    free_input_share: float
    probability: float = 0.0


@dataclass(frozen=True)
class Regime:
    """The gap of the recalibrated baseline in a part of what was recorded.

    Attributes:
        name: what distinguishes that part; several joined by "or" where this campaign cannot distinguish them.
        gap_percent: relative rms of the residual there, beyond the noise [%].
        p_value: probability of a misfit as concentrated there by chance, corrected for all regimes looked at.
    """

    name: str
    gap_percent: float
    p_value: float


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
    """A correction for something unknown: a force at a port, fitted on the nonlinear plant.

    Attributes:
        effect: its name as an effect of a model.
        port: name of the port.
        parameters: its coefficients with their 95 % intervals.
        identified: all its numbers, and those of the plant that were fitted beside it, SI, by name.
    """

    effect: str
    port: str
    parameters: tuple[Estimate, ...]
    identified: Mapping[str, float]


@dataclass(frozen=True)
class Candidate:
    """A hypothesis about what is missing.

    Attributes:
        hypothesis: the hypothesis.
        probability: its probability, all hypotheses sum to 1.
        score_sigma: significance at the null, nuisances projected out.
        heldout_gain: rise of the log predictive density of left-out tests over the baseline, per datum [nat].
        gain_beyond: the same of the last third of the tests, left out together.
        share_closed: share that it explains of what the recalibrated baseline leaves beyond the noise, all
            tests; NaN where it leaves nothing.
        parameters: those of its effects.
        refitted: whether it was fitted in full, or assessed by its score alone.
        ports: where it acts.
        families: of which kind what acts there is.
    """

    hypothesis: Hypothesis
    probability: float
    score_sigma: float
    heldout_gain: float
    share_closed: float
    parameters: tuple[Estimate, ...]
    refitted: bool
    ports: tuple[str, ...] = ()
    families: tuple[str, ...] = ()
    gain_beyond: float = nan

    @property
    def port(self) -> str | None:
        """Where it acts; None for nothing, something unknown, and for what acts at several ports."""
        return self.ports[0] if len(self.ports) == 1 else None

    @property
    def family(self) -> str | None:
        """Of which kind it is; None for nothing, something unknown, and for what is of several."""
        return self.families[0] if len(self.families) == 1 else None

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of its effects; none of them for none and unknown."""
        return self.hypothesis.effects


@dataclass(frozen=True)
class NextTest:
    """A test that would separate two hypotheses, with the significance to expect from it."""

    test: str
    separates: tuple[Hypothesis, Hypothesis]
    expected_sigma: float


@dataclass(frozen=True)
class NotJudgeable:
    """An effect that this campaign cannot show, and the smallest size of its parameter that it could have shown.

    It is in ``unit``, SI; infinite where no size that the effect may have would do.
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
        frequency_hz: of the test; one over the time that is drawn of a motion that does not repeat.
        displacement: [``motion_unit``], (n,).
        velocity: [``motion_unit``/s], (n,).
        inferred: inferred signal [``unit``], (n,); empty in windows, which have no signal of their own each.
        law: the named effect's law along the same motion [``unit``], (n,); empty if none is named.
        law_sd: its standard deviation [``unit``], (n,); empty if not known.
        nearest: the same by the nearest formula of the catalogue [``unit``], (n,); empty where the law is that.
        unit: N for a force, m or rad for what gives way, the channel's unit for a sensor.
        motion_unit: of the displacement.
    """

    port: str
    frequency_hz: float
    displacement: NDArray[np.float64]
    velocity: NDArray[np.float64]
    inferred: NDArray[np.float64]
    law: NDArray[np.float64]
    unit: str
    motion_unit: str = "m"
    law_sd: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    nearest: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True)
class Responses:
    """Harmonics of the plant's channels, complex, (D, C, K) each.

    Each is in the unit of its reading.
    """

    before: NDArray[np.complex128]
    recalibrated: NDArray[np.complex128]
    after: NDArray[np.complex128]

    def of_tests(self, kept: NDArray[np.intp], orders: int) -> "Responses":
        """Of some of the tests, orders 0..``orders``."""
        models = (self.before, self.recalibrated, self.after)
        return Responses(*(each[kept, :, : orders + 1] for each in models))


@dataclass(frozen=True)
class DriveForces:
    """The force of a drive along a measured motion, m rows each.

    Attributes:
        source: file that the motion came from.
        time: of each row since the first sample [s].
        velocity: of the motion [m/s].
        measured: force of the drive [N].
        before: the same that the baseline needs as given [N].
        recalibrated: the same of the recalibrated baseline [N].
        after: the same with what is named [N].
    """

    source: str
    time: NDArray[np.float64]
    velocity: NDArray[np.float64]
    measured: NDArray[np.float64]
    before: NDArray[np.float64]
    recalibrated: NDArray[np.float64]
    after: NDArray[np.float64]


@dataclass(frozen=True)
class Diagnosis(Result):
    """A whole diagnosis.

    Attributes:
        model: name of the baseline.
        effects: names of the effects in the baseline.
        given: the model as known before any fit.
        parameters: parameters of the recalibrated baseline, SI, by name.
        identified: parameters of the plant with the named effects, SI, by name.
        intervals: those that the baseline identifies, with the named effects beside them and their 95 % intervals.
        verdict: the verdict.
        ports: shares of all ports, largest first.
        map: the gap by channel, frequency and order.
        cycle: where in the cycle it lies.
        candidates: all hypotheses, most probable first.
        shrink: the gap over held-out tests, both channels together.
        by_channel: the same by channel.
        further: the gap of a recording that took no part, if there is one: a sweep, another motion.
        next_tests: tests that would distinguish what this campaign cannot.
        not_judgeable: effects that this campaign cannot show.
        confusable: pairs of effects that look alike in this campaign.
        loops: inferred signals at the named port.
        responses: what the three models predict: responses of dwells, or the force of the drive.
        measured: the dwells and windows that they are held against; None where it is the force of the drive.
        converged: whether every search that the verdict stands on converged: the recalibrated baseline, the fitted
            hypothesis with the greatest weight, what is named and its refit, the learned correction.
        warnings: what a reader must know, a sentence each.
        wall_s: how long it took [s].
        learned: the correction for something unknown, where it is a force and could be fitted.
        regimes: where in speed, stroke, load, direction, tests and time it lies, the most significant first.
        drifts: relative change of parameters from the first test to the last [1], by name: those that certainly
            change, where the baseline drifts by more than is tolerated.
    """

    presenter: ClassVar[str] = "DIAGNOSIS"

    model: str
    effects: tuple[str, ...]
    given: Model
    parameters: Mapping[str, float]
    identified: Mapping[str, float]
    intervals: tuple[Estimate, ...]
    verdict: Verdict
    ports: tuple[PortShare, ...]
    map: tuple[MapCell, ...]
    cycle: tuple[CyclePosition, ...]
    candidates: tuple[Candidate, ...]
    shrink: Shrink
    by_channel: Mapping[str, Shrink]
    further: FurtherShrink | None
    next_tests: tuple[NextTest, ...]
    not_judgeable: tuple[NotJudgeable, ...]
    confusable: tuple[Confusable, ...]
    loops: tuple[ForceLoop, ...]
    responses: Responses | DriveForces
    measured: HarmonicResponse | None
    converged: bool
    warnings: tuple[str, ...]
    wall_s: float
    learned: Learned | None = None
    regimes: tuple[Regime, ...] = ()
    drifts: Mapping[str, float] = field(default_factory=dict)

    def of_tests(self, kept: NDArray[np.intp]) -> "Diagnosis":
        """With the measurement and what the three models predict of some of the tests; all else is of all of them."""
        assert self.measured is not None
        assert isinstance(self.responses, Responses)
        measured = only_tests(self.measured, kept)
        return replace(self, measured=measured, responses=self.responses.of_tests(kept, measured.orders))

    @property
    def trusted(self) -> bool:
        """Whether every search that the verdict stands on ended well."""
        return self.converged


@dataclass(frozen=True)
class DiagnosisSettings:
    """How a diagnosis is done.

    Attributes:
        model: name of the baseline, for the report.
        baseline: effects in the baseline.
        free: parameters that recalibration identifies.
        orders: highest order of the harmonics that are compared.
        without: effects that are left out of the catalogue.
        periodic: how finely periodic motions are solved.
        constants: what the verdict is decided by.
    """

    model: str = ""
    baseline: tuple[str, ...] = ()
    free: tuple[str, ...] = ()
    orders: int = 9
    without: tuple[str, ...] = ()
    periodic: PeriodicSettings = field(default_factory=PeriodicSettings)
    constants: DecisionConstants = DEFAULTS
