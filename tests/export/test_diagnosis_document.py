"""diagnosis.json is checked before it is used: what is no diagnosis is refused with file, place and remedy."""

import json
from pathlib import Path
from typing import Any

import pytest

from savgs_ident.core.errors import InputError
from savgs_ident.export.diagnosis_document import read_diagnosis

from .diagnoses import MOUNT, NOTHING, UNKNOWN


def _written(folder: Path, document: object) -> Path:
    path = folder / "diagnosis.json"
    path.write_text(json.dumps(document), encoding="utf-8")
    return path


@pytest.mark.parametrize("document", [MOUNT, NOTHING, UNKNOWN], ids=["effect", "none", "unknown"])
def test_a_diagnosis_is_read_whole(tmp_path: Path, document: dict[str, Any]) -> None:
    assert read_diagnosis(_written(tmp_path, document)) == document


FAULTS: dict[str, tuple[object, str]] = {
    "a list": ([], "the document is [], not a table"),
    "another schema": (MOUNT | {"schema": 2}, "schema is 2"),
    "a model.json": ({"schema": 1, "kind": "savgs_ident model"}, "baseline is missing"),
    "no verdict": ({k: v for k, v in MOUNT.items() if k != "verdict"}, "verdict is missing"),
    "no kind": (MOUNT | {"verdict": {"effects": []}}, "verdict.kind is missing"),
    "named nothing": (MOUNT | {"verdict": MOUNT["verdict"] | {"effects": []}}, "of the kind 'effect'"),
    "nothing named": (MOUNT | {"verdict": MOUNT["verdict"] | {"kind": "none"}}, "of the kind 'none'"),
    "an effect that is none": (
        MOUNT | {"verdict": MOUNT["verdict"] | {"effects": ["magic"]}},
        "effects[0] is 'magic'",
    ),
    "a law that is a text": (
        MOUNT | {"verdict": MOUNT["verdict"] | {"another_law": "yes"}},
        "another_law is 'yes'",
    ),
    "values as texts": (MOUNT | {"identified": {"k_t": "soft"}}, "identified.k_t is 'soft'"),
    "a value that is null": (
        MOUNT | {"which": [{"effect": "x", "parameters": {"a": {"value": None, "unit": "m"}}}]},
        "which[0].parameters.a.value is None",
    ),
    "a text for a truth": (MOUNT | {"converged": "yes"}, "converged is 'yes'"),
}  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
def test_what_is_no_diagnosis_is_refused(tmp_path: Path, fault: str) -> None:
    document, said = FAULTS[fault]
    path = _written(tmp_path, document)
    with pytest.raises(InputError) as caught:
        read_diagnosis(path)
    assert said in caught.value.what
    assert caught.value.source == str(path)
    assert "savgs-ident diagnose" in caught.value.remedy
