"""Run the benchmarks, print a table, write a record.

    python -m benchmarks                                  everything: half an hour
    python -m benchmarks --quick                          four dwells, two minutes of MCAP, few draws
    python -m benchmarks --only response --only scipy --json benchmarks.json
    python -m benchmarks --only sindy --trials out/blind out/foreign
    python -m benchmarks --profile docs/profile.md        where the time of each command goes

Progress goes to standard error, the table to standard output.
"""

import argparse
import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import jax

from benchmarks.machine import describe_machine
from benchmarks.suite import NAMES, Size, run_suite
from benchmarks.table import make_table, print_table
from benchmarks.task import DWELLS_HZ, QUICK_HZ

TRIALS = (Path("out/blind"),)
FULL = Size(DWELLS_HZ, 60.0, 1000.0, 308, 150_000, TRIALS, 32)
QUICK = Size(QUICK_HZ, 2.0, 100.0, 24, 5000, TRIALS, 4)


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures there, flat keys")
    parser.add_argument(
        "--only", nargs="+", action="extend", choices=NAMES, metavar="NAME", help=", ".join(NAMES)
    )
    parser.add_argument("--quick", action="store_true", help="four dwells, two minutes of MCAP, few draws")
    parser.add_argument(
        "--trials",
        type=Path,
        nargs="+",
        metavar="DIR",
        default=TRIALS,
        help="what `savgs-ident blind` wrote, own or `--foreign`, for `sindy`",
    )
    parser.add_argument(
        "--profile", type=Path, metavar="FILE", help="write where the time of each command goes, nothing else"
    )
    options = parser.parse_args(arguments)

    # Results are fetched at once everywhere here; handing each call to another thread only delays them.
    jax.config.update("jax_cpu_enable_async_dispatch", False)
    began = time.perf_counter()
    size = (QUICK if options.quick else FULL)._replace(trials=tuple(options.trials))

    def progress(line: str) -> None:
        print(f"{time.perf_counter() - began:7.1f} s  {line}", file=sys.stderr, flush=True)

    if options.profile is not None:
        from benchmarks.profile import profile

        options.profile.write_text(profile(progress))
        return
    machine = describe_machine()
    outcome = run_suite(options.only or NAMES, size, progress)
    notes = (f"{len(size.dwells_hz)} dwells.", *outcome.notes)
    print_table(make_table(outcome.figures, notes, machine))
    if options.json is not None:
        record = {**outcome.figures, "dwells": len(size.dwells_hz), **machine}
        options.json.write_text(json.dumps(record, indent=2) + "\n")


if __name__ == "__main__":
    main()
