"""What is missing in a model of the positioner that has inertia and viscous friction only.

Laws are named on one recording; what they are worth is told on another one that nothing was fitted to.

    from savgs_ident.diagnosis.positioner.diagnose import diagnose_positioner
    from savgs_ident.diagnosis.positioner.recording import read_positioner

    found = diagnose_positioner(read_positioner(first), read_positioner(second))
    print(found.sentence)
"""

from dataclasses import dataclass

from savgs_ident.core.status import Status
from savgs_ident.diagnosis.positioner.agreement import (
    confusable_with,
    estimates_of,
    relative_error,
    share_closed,
    shrink_of,
)
from savgs_ident.diagnosis.positioner.plant import PositionerPlant, positioner_data
from savgs_ident.diagnosis.positioner.preparation import motion_of
from savgs_ident.diagnosis.positioner.recording import PositionerRecording
from savgs_ident.diagnosis.positioner.repeatability import repeatability_of
from savgs_ident.diagnosis.positioner.selection import Selection, Step, select_laws
from savgs_ident.diagnosis.result import Confusable, Estimate, Shrink
from savgs_ident.inference.find_map import LaplaceFit
from savgs_ident.inference.observations import Data


@dataclass(frozen=True)
class NamedStep:
    """A law that was added to the model, or dropped again.

    Attributes:
        term: its name.
        place: where on the axis it sits.
        added: whether it was added.
        sigma: significance of its score at the null, rows taken as independent; 0 if dropped.
        evidence_gain: log evidence that it brings.
        heldout_gain: rise of the log predictive density [nat] per row that it brings in parts left out.
        heldout_error: standard error of that, from its scatter over blocks of time.
        error: relative force error after the step [1], where it was fitted.
        heldout_recording_error: the same on the other recording [1].
        share_closed: share of the recalibrated gap that is closed on the other recording after the step.
        parameters: all parameters after the step.
    """

    term: str
    place: str
    added: bool
    sigma: float
    evidence_gain: float
    heldout_gain: float
    heldout_error: float
    error: float
    heldout_recording_error: float
    share_closed: float
    parameters: tuple[Estimate, ...]


@dataclass(frozen=True)
class Account:
    """A model with laws that were named, and what they are worth.

    Attributes:
        effects: names of the laws.
        parameters: all parameters.
        status: how the search for them ended.
        fitted: the gap on the recording that was fitted to. ``before`` is the baseline at round values, since
            nothing was known before the data.
        heldout: the gap on the other recording.
    """

    effects: tuple[str, ...]
    parameters: tuple[Estimate, ...]
    status: Status
    fitted: Shrink
    heldout: Shrink


@dataclass(frozen=True)
class PositionerDiagnosis:
    """What is missing, and how far it shrinks the gap.

    Attributes:
        textbook: the model with laws of the textbook.
        refined: the same with details, and without what these replace.
        steps: the way there.
        recalibrated: parameters of the baseline, refitted.
        noise: repeatability of a row of force [N].
        confusable: laws that look like a named one at the point where it was named.
    """

    textbook: Account
    refined: Account
    steps: tuple[NamedStep, ...]
    recalibrated: tuple[Estimate, ...]
    noise: float
    confusable: tuple[Confusable, ...]

    @property
    def details(self) -> tuple[str, ...]:
        """Laws of the refined model that the textbook's lacks."""
        return tuple(name for name in self.refined.effects if name not in self.textbook.effects)

    @property
    def replaced(self) -> tuple[str, ...]:
        """Laws of the textbook that are not needed beside the details."""
        return tuple(name for name in self.textbook.effects if name not in self.refined.effects)

    @property
    def sentence(self) -> str:
        """The verdict in one or two sentences."""
        if not self.textbook.effects and not self.details:
            return "Nothing is missing that this recording could show."
        gap = self.textbook.heldout
        said = (
            f"Missing: {_listed(self.textbook.effects)}; the force error on the recording held out falls from "
            f"{gap.recalibrated:.1%} (recalibrated) to {gap.after:.1%}."
        )
        if self.details:
            said += f" In detail: {_listed(self.details)} ({self.refined.heldout.after:.1%})"
            said += f", beside which {_listed(self.replaced)} is not needed." if self.replaced else "."
        return said


def diagnose_positioner(first: PositionerRecording, second: PositionerRecording) -> PositionerDiagnosis:
    """Names laws on the ``first`` recording and holds them against the ``second``.

    Raises :class:`InputError` for a recording that is too short or too slow, or a first one whose reference does not
    repeat.
    """
    motion, other = motion_of(first), motion_of(second)
    noise = repeatability_of(first, motion)
    plant = PositionerPlant(motion)
    data = positioner_data(first, motion, noise)
    selection = select_laws(plant, data)
    held = _Sides(
        (plant, data), (PositionerPlant(other), positioner_data(second, other, noise)), selection.base
    )
    return PositionerDiagnosis(
        textbook=held.account(selection.plain),
        refined=held.account(selection.refined),
        steps=tuple(held.step(each) for each in (*selection.textbook, *selection.details)),
        recalibrated=estimates_of(data, selection.base),
        noise=noise,
        confusable=_confusable(selection),
    )


_Side = tuple[PositionerPlant, Data]


@dataclass(frozen=True)
class _Sides:
    """The recording that was fitted to, the one held out, and the baseline."""

    fitted: _Side
    heldout: _Side
    base: LaplaceFit

    def account(self, mode: LaplaceFit) -> Account:
        fitted, heldout = (self._shrink(side, mode) for side in (self.fitted, self.heldout))
        return Account(mode.terms, estimates_of(self.fitted[1], mode), mode.status, fitted, heldout)

    def step(self, step: Step) -> NamedStep:
        left = self._shrink(self.heldout, step.mode)
        law = next(each for each in self.fitted[0].catalogue if each.term.name == step.term)
        return NamedStep(
            term=step.term,
            place=law.term.place,
            added=step.added,
            sigma=next((score.sigma for score in step.scores if score.term.name == step.term), 0.0),
            evidence_gain=step.evidence_gain,
            heldout_gain=step.heldout.mean,
            heldout_error=step.heldout.error,
            error=relative_error(self.fitted[1], step.mode.prediction.rows),
            heldout_recording_error=left.after,
            share_closed=share_closed(left.recalibrated, left.after, left.floor),
            parameters=estimates_of(self.fitted[1], step.mode),
        )

    def _shrink(self, side: _Side, mode: LaplaceFit) -> Shrink:
        plant, data = side
        before = plant.predict((), {each.name: each.value(0.0) for each in plant.nuisances}, (), None).rows
        refitted, after = (
            plant.predict(each.terms, each.values, (), None).rows for each in (self.base, mode)
        )
        return shrink_of(data, before, refitted, after)


def _listed(names: tuple[str, ...]) -> str:
    return ", ".join(names).replace("_", " ") or "nothing of the textbook"


def _confusable(selection: Selection) -> tuple[Confusable, ...]:
    """Look-alikes of every law at the point where it was added."""
    steps = (*selection.textbook, *selection.details)
    return tuple(each for step in steps if step.added for each in confusable_with(step.term, step.scores))
