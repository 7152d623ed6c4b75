"""The files of a diagnosis."""

from pathlib import Path

from savgs_ident.diagnose.result import Diagnosis
from savgs_ident.report.diagnosis_html import diagnosis_html
from savgs_ident.report.diagnosis_record import diagnosis_record
from savgs_ident.report.files import write_bytes, write_json
from savgs_ident.report.origin import Origin


def write_diagnosis(diagnosis: Diagnosis, origin: Origin, out: Path) -> tuple[Path, ...]:
    """Write diagnosis.json and diagnosis.html to the folder ``out``, each whole or not at all; their paths.

    Raises :class:`InputError` if a file cannot be written.
    """
    page = diagnosis_html(diagnosis, origin).encode()
    return (
        write_json(out / "diagnosis.json", diagnosis_record(diagnosis, origin)),
        write_bytes(out / "diagnosis.html", page),
    )
