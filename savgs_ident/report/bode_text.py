"""How far a model is from a measurement, as a table for the terminal."""

from typing import Any

from rich.console import Group, RenderableType

from savgs_ident.report.readings import READINGS
from savgs_ident.report.terminal import fixed, plain, table


def bode_text(record: dict[str, Any]) -> RenderableType:
    """The gap by channel, and the dwells that were not solved."""
    rows = [
        (
            READINGS[name].title if name in READINGS else name,
            fixed(100.0 * gap["relative"], 3),
            fixed(100.0 * gap["floor"], 3),
            fixed(gap["sigma"], 2),
        )
        for name, gap in record["gap"].items()
    ]
    count = len(record["tests"])
    parts = [
        table(
            f"Residual of the model on {count} dwells (rms)",
            ("channel", "residual\n[%]", "noise\n[%]", "residual\n[noise sd]"),
            rows,
        )
    ]
    failed = [
        test for test, status in zip(record["tests"], record["status"], strict=True) if status != "converged"
    ]
    if failed:
        parts.append(plain("The model's periodic motion was not found in: " + ", ".join(failed)))
    return Group(*parts)
