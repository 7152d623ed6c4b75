"""A sampler on the toy that keeps its chain, as a process of its own that a test can kill.

Arguments: sampler, evaluations after which it ends, a pickled toy with its surrogate, chain files. A line is
printed before the first step and after every step that is on disk, with the evaluations so far.
"""

import pickle
import sys
from contextlib import suppress
from pathlib import Path

import jax

from savgs_ident.inference.sample import SAMPLERS
from savgs_ident.inference.samplers.chains import Checkpoint, open_checkpoint
from savgs_ident.simulate.program_cache import use_persistent_cache

CASE = "toy"
SEED = 5


class _EnoughError(Exception):
    """As many evaluations as were asked for are on disk."""


class Told(Checkpoint):
    """A keep that says what it has published, and ends the run at ``last`` evaluations."""

    last: int

    def publish(self, scratch: Path, counts: tuple[int, int]) -> None:
        """Make the scratch file the kept one, and say so."""
        super().publish(scratch, counts)
        print(counts[0], flush=True)
        if counts[0] >= self.last:
            raise _EnoughError


def main(name: str, last: str, inputs: str, *paths: str) -> None:
    """Continue what is at ``paths``, one after the other."""
    jax.config.update("jax_enable_x64", True)
    use_persistent_cache()
    toy, surrogate = pickle.loads(Path(inputs).read_bytes())
    for path in paths:
        keep = open_checkpoint(Path(path), CASE)
        reported = Told(keep.path, keep.case, keep.content, keep.counts)
        reported.last = int(last)
        print(keep.counts[0], flush=True)
        with suppress(_EnoughError):
            for _ in SAMPLERS[name](toy, surrogate, SEED, reported):  # type: ignore[index]
                pass


if __name__ == "__main__":
    main(*sys.argv[1:])
