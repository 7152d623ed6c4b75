"""Give every loader damaged files, print how that ended, keep the inputs that fail.

    python -m fuzz                                        200 inputs a loader: a minute or two
    python -m fuzz --count 2000 --seed 1 --jobs 2 --out docs/fuzzing.md
    python -m fuzz --only csv mcap-json --count 500       two loaders
    python -m fuzz --only csv --seed 1 --again 137        one input again, with its traceback

Progress goes to standard error, the table to standard output. Exit code 1 if an input fails: another exception than
a refusal, a library's warning, a number that is not finite, too much time or memory, a process that ends.
"""

import argparse
import os
import shlex
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from fuzz.outcome import Kind, Outcome
from fuzz.pool import Batch, batches_of, run_side_by_side
from fuzz.registry import LOADERS
from fuzz.report import count, failures_text, page, table_text

FAILURES = Path("out/fuzz")


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; the exit code."""
    options = _parser().parse_args(arguments)
    names = options.only or list(LOADERS)
    if options.again is not None:
        batches = [Batch(name, (options.again,)) for name in names]
    else:
        batches = batches_of(names, options.count)
    outcomes = _run(batches, options.seed, options.jobs, options.keep)
    print(table_text(count(outcomes)))
    failures = failures_text(outcomes)
    if failures:
        print(f"\n{failures}\n\nInputs and tracebacks are in {options.keep}.")
    if options.out is not None:
        command = shlex.join(["python", "-m", "fuzz", *(sys.argv[1:] if arguments is None else arguments)])
        options.out.write_text(page(count(outcomes), command), encoding="utf-8")
        print(f"Written: {options.out}")
    return 1 if failures else 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m fuzz", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("--count", type=_positive, default=200, metavar="N", help="inputs for each loader (default: 200)")
    add("--seed", type=int, default=1, help="of all damage: the same seed gives the same inputs (default: 1)")
    add(
        "--jobs",
        type=_positive,
        default=os.cpu_count() or 1,
        metavar="N",
        help="processes (default: one a core)",
    )
    add(
        "--only",
        nargs="+",
        action="extend",
        choices=list(LOADERS),
        metavar="NAME",
        help="loaders to run: " + ", ".join(LOADERS),
    )
    add("--again", type=int, metavar="NUMBER", help="run the input with this number only")
    add(
        "--keep",
        type=Path,
        default=FAILURES,
        metavar="DIR",
        help=f"where inputs that fail are left (default: {FAILURES})",
    )
    add("--out", type=Path, metavar="FILE", help="write the page of the documentation there")
    return parser


def _positive(text: str) -> int:
    number = int(text)
    if number < 1:
        raise ValueError
    return number


def _run(batches: Sequence[Batch], seed: int, jobs: int, folder: Path) -> list[Outcome]:
    began, total = time.perf_counter(), sum(len(batch.numbers) for batch in batches)
    outcomes: list[Outcome] = []

    def print_progress(batch: Batch) -> None:
        failed = sum(each.kind is Kind.failed for each in outcomes)
        print(
            f"{time.perf_counter() - began:7.1f} s  {len(outcomes)} of {total} done, {failed} failed; "
            f"{batch.loader} from {batch.numbers[0]}",
            file=sys.stderr,
            flush=True,
        )

    # One by one: the progress that is printed counts them.
    outcomes.extend(run_side_by_side(batches, seed, jobs, folder, print_progress))
    return outcomes


if __name__ == "__main__":
    sys.exit(main())
