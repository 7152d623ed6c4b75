"""The counts of a run: as a table in the terminal, and as the page docs/fuzzing.md."""

import platform
from collections import Counter
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path

from fuzz.limits import MEMORY, SECONDS
from fuzz.outcome import Kind, Outcome
from fuzz.registry import LOADERS

PACKAGES = ("numpy", "pandas", "h5py", "mcap", "zstandard", "lz4")
_SHOWN = 40

_PAGE = Path(__file__).with_name("page.md")


def count(outcomes: Sequence[Outcome]) -> dict[str, Counter[Kind]]:
    """How the inputs of each loader ended."""
    counts: dict[str, Counter[Kind]] = {name: Counter() for name in LOADERS}
    for each in outcomes:
        counts[each.loader][each.kind] += 1
    return {name: each for name, each in counts.items() if each}


def table_text(counts: Mapping[str, Counter[Kind]]) -> str:
    """The table for a terminal."""
    lines = [f"{'loader':<16}{'inputs':>8}{'read':>8}{'refused':>9}{'failed':>8}"]
    for name, each in [*counts.items(), ("all", sum(counts.values(), Counter()))]:
        kinds = (each[Kind.read], each[Kind.refused], each[Kind.failed])
        lines.append(f"{name:<16}{each.total():>8}{kinds[0]:>8}{kinds[1]:>9}{kinds[2]:>8}")
    return "\n".join(lines)


def failures_text(outcomes: Sequence[Outcome]) -> str:
    """The failures, a line each; empty if there are none."""
    failed = [each for each in outcomes if each.kind is Kind.failed]
    lines = [f"{each.loader} {each.number}: {each.reason}" for each in failed[:_SHOWN]]
    more = [f"and {len(failed) - _SHOWN} more"] if len(failed) > _SHOWN else []
    return "\n".join([*lines, *more])


def page(counts: Mapping[str, Counter[Kind]], command: str) -> str:
    """The page of the documentation."""
    rows = ["| loader | file | form | inputs | read | refused | failures |", "|---|---|---|--:|--:|--:|--:|"]
    for name, each in counts.items():
        kinds = f"{each[Kind.read]} | {each[Kind.refused]} | {each[Kind.failed]}"
        loader = LOADERS[name]
        rows.append(f"| {name} | {loader.about} | {loader.form} | {each.total()} | {kinds} |")
    whole: Counter[Kind] = sum(counts.values(), Counter())
    total = (
        f"Together {whole.total()} inputs: {whole[Kind.read]} read, {whole[Kind.refused]} refused, "
        f"{whole[Kind.failed]} failures."
    )
    versions = [f"Python {platform.python_version()}", *(f"{name} {version(name)}" for name in PACKAGES)]
    return _PAGE.read_text("utf-8").format(
        seconds=SECONDS, memory=MEMORY >> 20, command=command, table="\n".join(rows), sum=total,
        versions=", ".join(versions),
    )  # fmt: skip
