"""What an export wrote, as the JSON object of ``export.json``, and in the terminal."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Group, RenderableType

from savgs_ident.export.gather import Gathered
from savgs_ident.report.model_origin import ModelOrigin
from savgs_ident.report.terminal import plain, table


def export_record(
    gathered: Gathered, written: Mapping[str, Sequence[Path]], origin: ModelOrigin
) -> dict[str, Any]:
    """The model, where its numbers come from, and the files by format."""
    model = gathered.model
    verdict = model.diagnosis.get("verdict")
    return {
        "schema": 1,
        "model": origin.model,
        "rig": origin.rig,
        "effects": list(origin.effects),
        "files": list(dict.fromkeys(str(file) for files in written.values() for file in files)),
        "formats": {name: [str(file) for file in files] for name, files in written.items()},
        "parameters": len(model.table),
        "covariance": len(model.covariance[0]),
        "samples": len(next(iter(model.samples.values()), ())),
        "verdict": verdict,
        "said": list(gathered.said),
        "trusted": not gathered.doubts,
        "doubts": list(gathered.doubts),
        "command": origin.command_line,
        "versions": dict(origin.versions),
    }


def export_text(record: Mapping[str, Any]) -> RenderableType:
    """What :func:`export_record` says, for people."""
    rows = [(name, ", ".join(files)) for name, files in record["formats"].items()]
    known = f"covariance of {record['covariance']}" if record["covariance"] else "no covariance"
    samples = f"{record['samples']} draws of a posterior" if record["samples"] else "no posterior"
    title = f"{record['rig']}: frictionless rig + {' + '.join(record['effects']) or 'nothing'}"
    return Group(
        plain(title, "bold"),
        plain(f"{record['parameters']} parameters, {known}, {samples}"),
        *(plain(sentence) for sentence in record["said"]),
        plain(""),
        table("Written", ("format", "files"), rows, (0, 1)),
    )
