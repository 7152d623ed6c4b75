"""The answer of a blind trial: what was drawn, and its seal. Pure functions.

The :class:`Answer` is the truth that the diagnosis must not see. Its seal shows whether it, or the recordings, were
changed after these were handed over. Beside the recordings stands a digest of the answer together with a salt, so
that it reveals nothing of the answer; answer and salt lie elsewhere, and are opened when the diagnosis has spoken.
The seal holds the digest of the recordings, too.

    seal = sealed(envelope, digest_of_recordings)
    ...
    opened(seal, envelope, digest_of_recordings)      # the answer, or an error

The marks of a diagnosis against it are in :mod:`savgs_ident.validation.blind_marks`.
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal

from savgs_ident.core.errors import InputError
from savgs_ident.core.files import record_of

Drawn = Literal["none", "effect", "two", "unknown", "foreign"]
"""What a trial's rig has beyond its model: nothing, an effect, two, one that the catalogue then lacks, or one whose
law no catalogue has."""


STANDS_OUT = 8.0
"""Standard deviations, expected, by which an effect must stand out of what calibration and tolerances do to be seen:
with that it does so by five however noise and tolerances fall."""


@dataclass(frozen=True)
class SmallErrors:
    """What no real rig is without, and no diagnosis is to take for an effect.

    Attributes:
        damper: relative errors of the damper's table, point by point [1].
        drift: relative change of the rail's friction over the campaign, about its mean [1].
        colour: correlation of the sensors' noise from one sample to the next [1].
        phase: angle by which the road's signal leads the road [rad].
    """

    damper: tuple[float, ...]
    drift: float
    colour: float
    phase: float


@dataclass(frozen=True)
class Answer:
    """The truth of a trial.

    Attributes:
        number: of the trial.
        kind: what was drawn.
        effects: names of the effects that the rig has beyond the baseline.
        ports: where they act, in the same order.
        changes: by how much each alone changes the clean response, relative; by effect.
        sigmas: by how many standard deviations each stands out of what noise, calibration and tolerances can do,
            the other one projected out; by effect.
        imitators: others of the catalogue that do the same to this campaign as one of the effects, within the noise.
        parameters: true values of the effects' parameters, SI.
        rig: true values of the rig's own parameters that are not those of the sheet, SI.
        without: effects that are removed from the catalogue for this trial.
        accepted: of a foreign effect, the ports that are right.
        families: of a foreign effect, the families that are right.
        small_errors: of a foreign trial; None in a trial of the catalogue's own effects, which has none.
        hidden: of a foreign effect, whether calibration leaves too little of it to matter.
    """

    number: int
    kind: Drawn
    effects: tuple[str, ...]
    ports: tuple[str, ...]
    changes: Mapping[str, float]
    sigmas: Mapping[str, float]
    imitators: tuple[str, ...]
    parameters: Mapping[str, float]
    rig: Mapping[str, float]
    without: tuple[str, ...]
    accepted: tuple[str, ...] = ()
    families: tuple[str, ...] = ()
    small_errors: SmallErrors | None = None
    hidden: bool = False

    @property
    def out_of_sight(self) -> frozenset[str]:
        """The effects of which calibration and tolerances leave too little to be seen."""
        if self.kind == "foreign":
            return frozenset(self.effects if self.hidden else ())
        return frozenset(name for name, sigma in self.sigmas.items() if sigma < STANDS_OUT)


_FOREIGN_ONLY = ("accepted", "families", "small_errors", "hidden")

_REMEDY = "record the trial again: remove its folder"


@dataclass(frozen=True)
class Seal:
    """Digests (SHA-256, hexadecimal) of the salted answer and of the recordings."""

    answer: str
    recordings: str


@dataclass(frozen=True)
class Envelope:
    """The answer and its salt (hexadecimal)."""

    answer: Answer
    salt: str


def sealed(envelope: Envelope, recordings: str) -> Seal:
    """The seal of an answer and of recordings with this digest."""
    return Seal(_digest(envelope), recordings)


def opened(seal: Seal, envelope: Envelope, recordings: str) -> Answer:
    """The answer; raises :class:`InputError` if it or the recordings are not those that were sealed."""
    if _digest(envelope) != seal.answer:
        raise InputError("the answer is not the one that was sealed", remedy=_REMEDY)
    if recordings != seal.recordings:
        raise InputError("the recordings are not those that were sealed", remedy=_REMEDY)
    return envelope.answer


def envelope_of(record: Mapping[str, Any]) -> Envelope:
    """The envelope from what ``dataclasses.asdict`` and JSON made of it; ``ValueError`` for something else."""
    return record_of(Envelope, {name: record.get(name) for name in ("answer", "salt")})


def _digest(envelope: Envelope) -> str:
    # What only foreign trials have is left out of the others: seals of earlier versions hold.
    answer = asdict(envelope.answer)
    given = {name: value for name, value in answer.items() if name not in _FOREIGN_ONLY or value}
    text = json.dumps(given, sort_keys=True, ensure_ascii=False)
    return hashlib.sha256(f"{envelope.salt}\n{text}".encode("utf-8", "surrogatepass")).hexdigest()
