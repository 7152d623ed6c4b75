"""How tests read what is said of a diagnosis: its text, its record."""

import io
import json
from typing import Any

from rich.console import Console

from savgs_ident.core.errors import DataWarning
from savgs_ident.core.files import to_json
from savgs_ident.core.presentation import Origin
from savgs_ident.diagnosis.result import Diagnosis
from savgs_ident.report.diagnosis.record import diagnosis_record

from .page_reader import HOSTILE

SHOWN = HOSTILE.replace("\x1b", "\\x1b").replace("\u202e", "\\u202e")
ORIGIN = Origin(
    ("savgs-ident", "diagnose", "a & b.csv"), "runs/a<b>.csv", "ab" * 32, "m & m.toml", {"savgs-ident": "0.1.0"},
    (DataWarning("odd", "something", test="dwell_2"),),
)  # fmt: skip


def rendered(diagnosis: Diagnosis, width: int = 100) -> str:
    stream = io.StringIO()
    Console(file=stream, width=width, highlight=False).print(diagnosis.rendered())
    return stream.getvalue()


def record_of(diagnosis: Diagnosis) -> dict[str, Any]:
    return dict(json.loads(to_json(diagnosis_record(diagnosis, ORIGIN))))
