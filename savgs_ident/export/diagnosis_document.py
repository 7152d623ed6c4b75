"""A diagnosis as data: the ``diagnosis.json`` that ``savgs-ident diagnose`` wrote, checked before it is used.

Of the whole document, this looks at what an export needs; everything else travels along as it is.
"""

from collections.abc import Mapping
from pathlib import Path

from savgs_ident.effects.registry import CATALOGUE, EFFECTS, LEARNED
from savgs_ident.export.place import Place, read_document

SCHEMA = 1
"""Of the diagnoses that can be read."""

KINDS = ("none", "effect", "several", "unknown")
"""Of verdicts."""

REMEDY = "give the diagnosis.json that `savgs-ident diagnose` wrote"

_TOP = ("schema", "baseline", "verdict", "where", "which", "shrink", "next_test")
_VERDICT = ("kind", "effects", "ports", "confusable_with", "sentence")


def read_diagnosis(path: Path) -> dict[str, object]:
    """The whole document. Raises :class:`InputError` for a file that cannot be read or is no diagnosis."""
    return read_document(path, REMEDY, parse_diagnosis)


def parse_diagnosis(place: Place) -> dict[str, object]:
    """The document at a place. Raises :class:`InputError` for what is no diagnosis."""
    fields = place.table(_TOP, free=True)
    schema = fields["schema"]
    if schema.value != SCHEMA or isinstance(schema.value, bool):
        raise schema.wrong(f"the schema {SCHEMA}")
    baseline = fields["baseline"].table(("model", "parameters"), free=True)
    baseline["model"].text()
    _numbers(baseline["parameters"])
    if "effects" in baseline:
        baseline["effects"].names(tuple(EFFECTS))
    _check_verdict(fields["verdict"])
    for candidate in fields["which"].items():
        _check_candidate(candidate)
    if "identified" in fields:
        _numbers(fields["identified"])
    if "learned" in fields and fields["learned"].value is not None:
        _check_learned(fields["learned"])
    if "converged" in fields and not isinstance(fields["converged"].value, bool):
        raise fields["converged"].wrong("true or false")
    if "provenance" in fields:
        fields["provenance"].entries()
    return dict(_as_table(place))


def _check_verdict(place: Place) -> None:
    fields = place.table(_VERDICT, free=True)
    kind = fields["kind"].text(KINDS)
    named = fields["effects"].names(tuple(CATALOGUE))
    if (kind in ("effect", "several")) != bool(named):
        raise fields["effects"].wrong(f"what belongs to a verdict of the kind '{kind}'")
    fields["ports"].names()
    fields["confusable_with"].names()
    fields["sentence"].text()
    if "confusable_ports" in fields:
        fields["confusable_ports"].names()
    if "another_law" in fields and not isinstance(fields["another_law"].value, bool):
        raise fields["another_law"].wrong("true or false")


def _check_candidate(place: Place) -> None:
    fields = place.table(("effect", "parameters"), free=True)
    fields["effect"].text()
    for entry in fields["parameters"].entries().values():
        entry.table(("value", "unit"), free=True)["value"].number()


def _check_learned(place: Place) -> None:
    fields = place.table(("effect", "parameters", "identified"), free=True)
    fields["effect"].text(tuple(LEARNED))
    for entry in fields["parameters"].entries().values():
        entry.table(("value", "unit"), free=True)["value"].number()
    _numbers(fields["identified"])


def _numbers(place: Place) -> dict[str, float]:
    return {name: entry.number() for name, entry in place.entries().items()}


def _as_table(place: Place) -> Mapping[str, object]:
    return {name: entry.value for name, entry in place.entries().items()}
