"""Regression of the product's numbers: record them with one version of the code, compare two records.

    python -m benchmarks.numbers record out/numbers/old --code ../old-checkout
    python -m benchmarks.numbers record out/numbers/new --model out/numbers/old/model.toml
    python -m benchmarks.numbers compare out/numbers/old out/numbers/new

Only the command line is used (``python -m savgs_ident.cli COMMAND --json --quiet --out DIR``), so that one script
measures any version: ``--code`` names the checkout to run (this one by default), ``--data`` the folder of labelled
rig recordings (by default ``../shared/data/rig`` relative to the repository).

**record** runs the commands of :data:`FIGURES` and writes ``FOLDER/<name>.json`` for each: command, exit code, wall
time (at first use with compilation), JSON result, written files and JSON documents. A figure whose file exists is not
run again; delete the file to repeat it. Commands that need an identified model read ``FOLDER/model.toml``: a copy of
``--model FILE`` or, without it, the model of ``fit-csv``. To compare versions, record both with the old model.

``blind`` takes hours and runs only with ``--only blind``. It continues where it was stopped, and appends a line for
each finished trial to ``FOLDER/out/blind/trials.jsonl``. Both versions draw the same campaigns as long as the draw
and the simulator are the same; ``compare`` checks the true effects. To diagnose the old recordings in any case, copy
``rig.toml`` and ``out/blind`` without ``trials.jsonl`` into the new folder first.

**compare** prints quantity, old value, new value, difference in units of its tolerance, and ``ok`` (up to 1) or
``NOT``. What only the new record has is ignored; what only the old one has is ``NOT``. The exit code is 1 if there is
any ``NOT``. The tolerances are in :data:`TOLERANCES` and in the functions that begin with ``compare_``.
"""

import argparse
import hashlib
import json
import math
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import reduce
from operator import getitem
from pathlib import Path
from typing import Any, NamedTuple

REPOSITORY = Path(__file__).resolve().parents[1]

FIGURES = {
    "fit-csv": "fit {data}/nominal/campaign.csv.gz",
    "fit-json-mcap": "fit {data}/nominal/campaign_json.mcap",
    "fit-ros2-mcap": "fit {data}/nominal/campaign_ros2.mcap",
    "linearise": "linearise model.toml",
    "simulate-dwells": "simulate model.toml",
    "simulate-sweep": "simulate model.toml --sweep",
    "design": "design model.toml",
    "closed-loop-harmonic": "closed-loop model.toml",
    "closed-loop-sweep": "closed-loop model.toml --test sweep --rigs 0",
    "closed-loop-iso": "closed-loop model.toml --test iso --rigs 0",
    "closed-loop-bump": "closed-loop model.toml --test bump --rigs 0",
    "export": "export model.toml --to json --to mat --to python-control --to casadi --to c --to fmu",
    "diagnose-stribeck_rail": "diagnose {data}/stribeck_rail/campaign.csv.gz",
    "diagnose-accel_lag": "diagnose {data}/accel_lag/campaign.csv.gz",
    "diagnose-mount_compliance": "diagnose {data}/mount_compliance/campaign.csv.gz",
    "diagnose-nominal": "diagnose {data}/nominal/campaign.csv.gz",
    "posterior": "posterior model.toml {data}/nominal/campaign.csv.gz",
    "blind": "blind --trials 30 --seed 21 --jobs 1 --rig rig.toml",
}
"""Command lines of savgs-ident in the order in which they run, in the folder of the record."""

PROVENANCE = {"schema", "provenance", "origin", "command", "model", "data", "source", "warnings", "wall_s"}
"""Keys that say what a document is and where it comes from; numbers below them are not compared."""

MISSING = "(missing)"


class Row(NamedTuple):
    """One compared quantity; ``difference`` is in units of the tolerance, ok up to 1 (and not ok if NaN)."""

    quantity: str
    old: Any
    new: Any
    difference: float


Rows = Iterator[Row]


class Pair(NamedTuple):
    """The same part of the old and of the new record, and its path."""

    old: Any
    new: Any
    path: str = ""

    def at(self, *keys: str | int) -> "Pair":
        """The part below; :data:`MISSING` where a record has no such part."""

        def below(document: Any) -> Any:
            try:
                return reduce(getitem, keys, document)
            except (KeyError, IndexError, TypeError):
                return MISSING

        path = ".".join(str(key) for key in (self.path, *keys) if key != "")
        return Pair(below(self.old), below(self.new), path.removeprefix("result."))

    def near(self, tolerance: float) -> Row:
        """Difference of two numbers in units of ``tolerance``; equality of anything else, and with 0.

        A part that the old record lacks is not compared.
        """
        difference = 0.0 if self.old in (self.new, MISSING) else math.inf
        if difference and tolerance > 0.0 and _is_number(self.old) and _is_number(self.new):
            difference = abs(self.new - self.old) / tolerance
        return Row(self.path, self.old, self.new, difference)

    def relative(self, tolerance: float) -> Row:
        """The worst of all numbers, truth values and nulls of two documents, relative to ``tolerance``.

        The scale of a number is its magnitude, and in a list at least a thousandth of the largest magnitude there,
        so that rounding errors of entries near zero do not count. Texts and :data:`PROVENANCE` are left out.
        """
        new = {path: number for path, number, _ in _leaves(self.new, self.path)}
        old = _leaves(self.old, self.path)
        return worst(
            [Pair(each, new.get(path, MISSING), path).near(tolerance * scale) for path, each, scale in old]
        )


def _is_number(thing: Any) -> bool:
    return isinstance(thing, int | float) and not isinstance(thing, bool)


def _leaves(document: Any, path: str = "", scale: float = 0.0) -> Iterator[tuple[str, Any, float]]:
    """Path, value and scale of every leaf that is not a text, and the lengths of lists."""
    if isinstance(document, Mapping):
        for key, each in document.items():
            if key not in PROVENANCE and "sha256" not in key:
                yield from _leaves(each, f"{path}.{key}" if path else key)
    elif isinstance(document, list):
        yield f"{path}.length", len(document), 0.0
        largest = max((abs(each) for each in document if _is_number(each)), default=0.0)
        for index, each in enumerate(document):
            yield from _leaves(each, f"{path}[{index}]", 1e-3 * largest)
    elif not isinstance(document, str):
        yield path, document, max(abs(document), scale) if _is_number(document) else 0.0


def worst(rows: Sequence[Row]) -> Row:
    """The row with the largest difference, to stand for all of them."""
    if len(rows) < 2:
        return rows[0] if rows else Row("no numbers", "", "", 0.0)
    row = max(rows, key=lambda each: math.inf if math.isnan(each.difference) else each.difference)
    return row._replace(quantity=f"worst of {len(rows)}: {row.quantity}")


TOLERANCES: tuple[tuple[str, Callable[[Pair, float], Row], float, str], ...] = (
    ("fit", Pair.relative, 5e-3, "chi2"),
    ("fit", Pair.near, 0.0, "dof converged"),
    ("fit", Pair.relative, 0.03, "gap"),
    ("diagnose", Pair.relative, 0.03, "shrink.before shrink.recalibrated shrink.after shrink.floor"),
    ("diagnose", Pair.near, 0.02, "which.0.probability"),
    ("diagnose", Pair.near, 0.0, "which.0.effect converged"),
    ("posterior", Pair.near, 0.0, "converged"),
    ("linearise", Pair.relative, 1e-3, "."),
    ("simulate", Pair.near, 0.0, "status"),
    ("simulate", Pair.relative, 1e-6, "."),
    ("design", Pair.near, 1e-4, "gamma gamma_least peak peak_in_use"),
    ("design", Pair.near, 0.0, "order gamma_confirmed trusted"),
    ("design", Pair.relative, 1e-3, "margins robustness"),
    ("closed-loop", Pair.near, 0.1, "rms_reduction_percent.sprung_accel rms_reduction_percent.susp_deflection"),
    ("closed-loop", Pair.near, 0.1, "tyre_load_rms_change_percent link_angle_range_deg.0 link_angle_range_deg.1"),
    ("closed-loop", Pair.relative, 0.01, "motor_speed_peak_rpm peak_power_w energy_j"),
    ("closed-loop", Pair.near, 1e-3, "saturated_fraction"),
    ("closed-loop", Pair.near, 0.0, "stable"),
)  # fmt: skip
"""Command, comparison, tolerance (0 means equal) and the paths in its JSON result to which they apply."""


def compare_fit(record: Pair) -> Rows:
    """Parameters within 0.05 of their old standard errors, those within 2 %."""
    parameters = record.at("result", "parameters")
    for name, entry in parameters.old.items():
        yield parameters.at(name, "value").near(0.05 * (entry["stderr"] or 0.0))
    yield worst([parameters.at(name, "stderr").relative(0.02) for name in parameters.old])


def compare_diagnose(record: Pair) -> Rows:
    """Verdict equal; parameters of the most probable hypothesis within a quarter of their standard deviation."""
    yield from compare_verdict(record.at("result", "verdict"))
    parameters = record.at("result", "which", 0, "parameters")
    for name, entry in parameters.old.items():
        # The interval of 95 % is 2 x 1.96 standard deviations wide.
        yield parameters.at(name, "value").near(0.25 * (entry["hi"] - entry["lo"]) / 3.92)


def compare_verdict(verdict: Pair) -> Rows:
    """Kind, effects and ports equal, in any order."""
    yield verdict.at("kind").near(0.0)
    for name in ("effects", "ports"):
        old, new, path = verdict.at(name)
        yield Pair(sorted(old), sorted(new), path).near(0.0)


def compare_posterior(record: Pair) -> Rows:
    """Medians and standard deviations within four standard errors of their Monte Carlo difference.

    That of a median of ``ess`` independent normal draws is sqrt(pi/2) sd/sqrt(ess), that of their sd sd/sqrt(2 ess).
    """
    for name in record.old["result"]["parameters"]:
        entry = record.at("result", "parameters", name)
        known = [each for each in (entry.old, entry.new) if each != MISSING]
        error = 4.0 * math.hypot(*(each["sd"] / math.sqrt(each["ess_bulk"]) for each in known))
        yield entry.at("median").near(math.sqrt(math.pi / 2.0) * error)
        yield entry.at("sd").near(math.sqrt(0.5) * error)


def compare_export(record: Pair) -> Rows:
    """The same files; all numbers of the JSON documents within a thousandth."""
    yield record.at("files").near(0.0)
    yield from (record.at("documents", name).relative(1e-3) for name in record.old["documents"])


def compare_blind(record: Pair) -> Rows:
    """The verdict of every trial; its true effects, too, as a check of the draw."""
    for name in record.old["documents"]:
        document = record.at("documents", name)._replace(path=name.split("/")[0])
        if name.endswith("answer.json"):
            yield document.at("answer", "effects").near(0.0)
        elif name.endswith("diagnosis.json"):
            yield from compare_verdict(document.at("verdict"))


COMPARISONS: dict[str, Callable[[Pair], Rows]] = {
    "fit": compare_fit,
    "diagnose": compare_diagnose,
    "posterior": compare_posterior,
    "export": compare_export,
    "blind": compare_blind,
}
"""What is compared beside :data:`TOLERANCES`."""


def compare_results(command: str, record: Pair) -> Rows:
    """All comparisons of a command."""
    yield record.at("code").near(0.0)
    if record.old.get("result") is None or record.new.get("result") is None:
        yield Row("JSON results of both", "", "", math.inf)
        return
    if command == "simulate":
        yield record.at("model_sha256").near(0.0)
    if command in COMPARISONS:
        yield from COMPARISONS[command](record)
    for name, compare, tolerance, paths in TOLERANCES:
        for path in paths.split() if name == command else ():
            keys = [int(key) if key.isdigit() else key for key in path.split(".") if key]
            yield compare(record.at("result", *keys), tolerance)


def record_figures(folder: Path, figures: Sequence[str], options: argparse.Namespace) -> None:
    """Run the figures that ``folder`` does not hold yet."""
    folder.mkdir(parents=True, exist_ok=True)
    kept, rig, model = folder / "model.toml", folder / "rig.toml", options.model
    if kept.exists() and model is not None and kept.read_bytes() != model.read_bytes():
        sys.exit(f"{kept} is another model than {model}: name another FOLDER")
    if not rig.exists():
        # Blind trials belong to the path of a rig file: a relative one is the same in every record.
        shutil.copyfile(options.code / "data" / "rig" / "gt_rear.toml", rig)
    for name in figures:
        file = folder / f"{name}.json"
        if file.exists():
            print(f"{name}: recorded before", flush=True)
            continue
        if "model.toml" in FIGURES[name] and not kept.exists():
            shutil.copyfile(model or folder / "out" / "fit-csv" / "model.toml", kept)
        content = run_figure(folder, name, options.code.resolve(), options.data.resolve())
        begun = file.with_suffix(".part")
        begun.write_text(json.dumps(content, indent=1) + "\n")
        begun.replace(file)
        print(f"{name}: exit code {content['code']}, {content['wall_s']:.0f} s", flush=True)


def run_figure(folder: Path, name: str, code: Path, data: Path) -> dict[str, Any]:
    """Run one command and return what its record holds; a run that was stopped ends the program."""
    out, model = folder / "out" / name, folder / "model.toml"
    words = [word.format(data=data) for word in FIGURES[name].split()]
    words += ["--json", "--quiet", "--out", f"out/{name}"]
    environment = os.environ | {"PYTHONPATH": str(code), "SAVGS_IDENT_CACHE": str(folder.resolve() / "cache")}
    began = time.perf_counter()
    # Python looks for packages in the working directory first, which must not be a checkout.
    command = [sys.executable, "-m", "savgs_ident.cli", *words]
    ran = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    wall_s = time.perf_counter() - began
    if ran.returncode < 0 or ran.returncode == 130:
        sys.exit(f"{name} was stopped (exit code {ran.returncode}): start again to continue")
    git = ["git", "-C", str(code), "describe", "--always", "--dirty"]
    files = sorted(path.relative_to(out).as_posix() for path in out.rglob("*") if path.is_file())
    return {
        "command": words,
        "version": subprocess.run(git, capture_output=True, text=True).stdout.strip(),
        "model_sha256": hashlib.sha256(model.read_bytes()).hexdigest() if model.exists() else None,
        "code": ran.returncode,
        "wall_s": wall_s,
        "stderr": ran.stderr[-4000:],
        "result": json.loads(ran.stdout or "null"),
        "files": files,
        "documents": {each: json.loads((out / each).read_text()) for each in files if each.endswith(".json")},
    }


def compare_records(old: Path, new: Path, figures: Sequence[str]) -> int:
    """Print the comparison of two records; the exit code."""
    failed: list[str] = []
    for name in figures:
        files = [folder / f"{name}.json" for folder in (old, new)]
        record = Pair(*(json.loads(file.read_text()) if file.exists() else {} for file in files))
        print(f"\n{name}: {record.old.get('wall_s', 0):.0f} s, now {record.new.get('wall_s', 0):.0f} s")
        for row in compare_results(FIGURES[name].split()[0], record):
            ok = row.difference <= 1.0
            values = f"{_shown(row.old):>24} {_shown(row.new):>24} {row.difference:9.3g}"
            print(f"  {row.quantity:<64} {values}  {'ok' if ok else 'NOT'}")
            failed += [] if ok else [f"{name}: {row.quantity}"]
    print(f"\n{len(failed)} NOT ok", *failed, sep="\n  ")
    return 1 if failed else 0


def _shown(thing: Any) -> str:
    text = f"{thing:.8g}" if _is_number(thing) else thing if isinstance(thing, str) else json.dumps(thing)
    return text if len(text) <= 24 else f"{text[:21]}..."


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.numbers", description=__doc__.splitlines()[0])
    modes = parser.add_subparsers(dest="mode", required=True)
    record = modes.add_parser("record", help="run the figures that FOLDER does not hold yet")
    record.add_argument("folder", type=Path)
    record.add_argument("--model", type=Path, help="identified model for the other commands")
    record.add_argument("--code", type=Path, default=REPOSITORY, help="checkout to run")
    record.add_argument("--data", type=Path, default=REPOSITORY / "../shared/data/rig", help="recordings")
    comparison = modes.add_parser("compare", help="compare two records")
    comparison.add_argument("old", type=Path)
    comparison.add_argument("new", type=Path)
    for each in (record, comparison):
        each.add_argument("--only", nargs="+", choices=FIGURES, help="figures; by default all but blind")
    options = parser.parse_args(arguments)
    figures = [name for name in FIGURES if (name in options.only if options.only else name != "blind")]
    if options.mode == "compare":
        return compare_records(options.old, options.new, figures)
    record_figures(options.folder, figures, options)
    return 0


if __name__ == "__main__":
    sys.exit(main())
