"""What samplers have in common: their options, their draws, the exact density, and the chain on disk.

A checkpoint is what a run leaves behind at every step, so that it can be stopped and continued. The file is HDF5. It
is written elsewhere and moved to its place, so that a run that is killed at any moment leaves the state after some
step, whole. The file says what it is a chain of; another problem's is refused. Behind the HDF5 stands its digest
(SHA-256): a file that is not as it was written is refused before HDF5 reads it.
"""

import hashlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import NamedTuple

import equinox as eqx
import h5py
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from savgs_ident.core.errors import InputError
from savgs_ident.core.files import scratch_folder, write_bytes
from savgs_ident.inference.likelihood import RowLikelihood
from savgs_ident.inference.near_mode import ExactModel
from savgs_ident.inference.prior import Prior
from savgs_ident.inference.result import Sampler
from savgs_ident.simulate.periodic import PeriodicSettings
from savgs_ident.simulate.program_cache import placed


class Chains(NamedTuple):
    """Draws so far, in S steps of C chains.

    Attributes:
        points: free coordinates and nuisance scales [1], (S, C, n + 2).
        log_density: log density of the exact model, (S, C).
        accepted: whether the step moved, (S, C).
        log_ratio: log ratio of exact to surrogate density at proposals that are nearly draws of the surrogate; empty
            where a sampler has none.
        divergences: of the gradient-based sampler.
        evaluations: responses of the exact model.
        unsolved: of these without a periodic motion.
    """

    points: Float[np.ndarray, "S C n+2"]
    log_density: Float[np.ndarray, "S C"]
    accepted: Bool[np.ndarray, "S C"]
    log_ratio: Float[np.ndarray, " k"]
    divergences: int
    evaluations: int
    unsolved: int


def steps_without_density(log_density: Float[np.ndarray, "S C"]) -> int:
    """Leading steps at which some chain still stands where the posterior has no density.

    ``log_density`` [1] is minus infinity there. Such a state is no draw, whether the model was not solved there or
    its density is zero; a chain leaves it once and does not return.
    """
    positive = np.isfinite(log_density).all(axis=1)
    return int(np.argmax(positive)) if positive.any() else len(positive)


_ATTRIBUTE = "savgs_ident_case"
_DIGEST = hashlib.sha256().digest_size


class Checkpoint:
    """The chain file at ``path`` for the case with digest ``case``; ``counts`` are (evaluations, unsolved).

    Without a path nothing is kept.
    """

    def __init__(self, path: Path | None, case: str, content: bytes | None, counts: tuple[int, int]) -> None:
        self.path, self.case, self.content, self.counts = path, case, content, counts

    @contextmanager
    def scratch(self) -> Iterator[Path]:
        """A file to write to, which holds what was kept so far."""
        with scratch_folder() as folder:
            file = folder / "chain.h5"
            if self.content is not None:
                file.write_bytes(self.content)
            yield file

    def publish(self, scratch: Path, counts: tuple[int, int]) -> None:
        """Make the scratch file the kept one."""
        if self.path is None:
            return
        with h5py.File(scratch, "a") as file:
            file.attrs[_ATTRIBUTE] = self.case
            file.attrs["counts"] = counts
        content = scratch.read_bytes()
        write_bytes(self.path, content + hashlib.sha256(content).digest())


def new_checkpoint(path: Path | None, case: str) -> Checkpoint:
    """A checkpoint that begins empty; what was there is replaced after the first step."""
    return Checkpoint(path, case, None, (0, 0))


def open_checkpoint(path: Path, case: str) -> Checkpoint:
    """The checkpoint of an earlier run; an empty one if that was stopped before its first step.

    Raises :class:`InputError` if it cannot be read or is the chain of another case.
    """
    try:
        content = _whole(path.read_bytes())
        with h5py.File(BytesIO(content), "r") as file:
            written_for, counts = file.attrs[_ATTRIBUTE], file.attrs["counts"]
    except FileNotFoundError:
        return new_checkpoint(path, case)
    except (OSError, KeyError, ValueError) as error:
        raise InputError(
            f"is no chain that can be resumed: {error}", source=path, remedy="leave out --resume"
        ) from error
    if written_for != case:
        raise InputError(
            "is the chain of other data, another model, other options or another version",
            source=path,
            remedy="resume with what it was begun with, or leave out --resume",
        )
    return Checkpoint(path, case, content, (int(counts[0]), int(counts[1])))


def _whole(content: bytes) -> bytes:
    """A file's content without the digest that it ends with; ``ValueError`` if it is not of this content."""
    begun, digest = content[:-_DIGEST], content[-_DIGEST:]
    if hashlib.sha256(begun).digest() != digest:
        raise ValueError("it is not as it was written")
    return begun


def digest_of(parts: Mapping[str, object]) -> str:
    """A digest of named numbers, arrays and texts."""
    digest = hashlib.sha256()
    for name, value in parts.items():
        digest.update(name.encode())
        digest.update(value.tobytes() if isinstance(value, np.ndarray) else repr(value).encode())
    return digest.hexdigest()


class Decision(NamedTuple):
    """Log density (W,), minus infinity where the model was not ``solved`` (W,)."""

    log_density: Float[np.ndarray, " W"]
    solved: Bool[np.ndarray, " W"]


def decide(exact: ExactModel, prior: Prior, points: Float[np.ndarray, "W n+2"]) -> Decision:
    """The exact log density at points."""
    rows, solved = exact.rows(points[:, :-2])
    safe = np.where(solved[:, None], rows, 0.0)
    values = np.asarray(
        _densities(exact.likelihood, prior, *placed((jnp.asarray(safe), jnp.asarray(points))))
    )
    return Decision(np.where(solved & np.isfinite(values), values, -np.inf), solved)


@eqx.filter_jit
def _densities(likelihood: RowLikelihood, prior: Prior, rows: Array, points: Array) -> Array:
    return jax.vmap(lambda row, point: likelihood(row, point) + prior(point))(rows, points)


@dataclass(frozen=True)
class SamplingSettings:
    """How to sample.

    Attributes:
        sampler: "emcee" or "nuts".
        target_ess: effective sample size, bulk and tail, that every identified parameter is to reach [1].
        time_limit_s: time after which sampling ends without [s].
        patience_s: time up to which sampling goes on beyond the target [s], until the Monte-Carlo error of every
            median is below :data:`savgs_ident.inference.diagnostics.PRECISE`.
        fixed_tolerances: take the parameters with a tolerance as exact instead of marginalising over them.
        orders: highest harmonic order that is compared.
        seed: of all random numbers.
        predictive_draws: draws at which the model's prediction is kept.
        periodic: how finely to solve the model.
    """

    sampler: Sampler = "emcee"
    target_ess: float = 1000.0
    time_limit_s: float = 600.0
    patience_s: float = 30.0
    fixed_tolerances: bool = False
    orders: int = 9
    seed: int = 1
    predictive_draws: int = 200
    periodic: PeriodicSettings = field(default_factory=PeriodicSettings)
