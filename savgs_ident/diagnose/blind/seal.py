"""The seal: nobody can change the answer of a trial after its recordings were handed over and go unnoticed.

Beside the recordings stands a digest of the answer together with a salt, so that it tells nothing of the answer;
answer and salt lie elsewhere, and are opened when the diagnosis has spoken. The seal holds the digest of the
recordings, too.

    seal = sealed(answer, salt, digest_of_recordings)
    ...
    opened(seal, envelope, digest_of_recordings)      # the answer, or an error
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from savgs_ident.core.errors import InputError
from savgs_ident.core.records import record_of
from savgs_ident.diagnose.blind.answer import Answer

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
    text = json.dumps(asdict(envelope.answer), sort_keys=True, ensure_ascii=False)
    return hashlib.sha256(f"{envelope.salt}\n{text}".encode("utf-8", "surrogatepass")).hexdigest()
