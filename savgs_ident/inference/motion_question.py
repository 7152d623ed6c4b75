"""What the force of a drive says of a model: the question that a posterior answers along a measured motion."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from savgs_ident.core.errors import InputError
from savgs_ident.core.free_vector import FreeVector, known_to_tolerance
from savgs_ident.core.presentation import Progress
from savgs_ident.core.threads import in_parallel
from savgs_ident.core.values import Values, as_values
from savgs_ident.inference.drive_force import ForceRows, force_data, force_rows
from savgs_ident.inference.likelihood import RowLikelihood
from savgs_ident.inference.near_mode import LinearisationPoint, LinearRows
from savgs_ident.inference.observations import Data
from savgs_ident.inference.posterior_mode import PosteriorDensity, PosteriorMode, find_mode
from savgs_ident.inference.prior import Prior
from savgs_ident.inference.problem import check_free, used_parameters
from savgs_ident.inference.result import MotionPosterior, PredictedForce
from savgs_ident.inference.samplers.chains import Chains, SamplingSettings
from savgs_ident.plants.base import AbstractPlant
from savgs_ident.plants.model import Model
from savgs_ident.responses.driven_motion import DrivenMotion

WITHIN = (0.025, 0.975)
"""Quantiles of repetitions between which 95 % of them lie."""


@dataclass(frozen=True)
class SampledForce:
    """A model along a measured motion, as a posterior asks for it.

    Attributes:
        plant: the model with its effects.
        values: all its parameters, SI.
        motion: what was measured.
        free: the parameters that are sampled.
    """

    plant: AbstractPlant
    values: Values
    motion: DrivenMotion
    free: FreeVector

    def force(self, u: Float[Array, " n"], names: Sequence[str] = ()) -> ForceRows:
        """The force that is needed at free coordinates ``u``, with slopes in those named [N per SI unit]."""
        p = {**self.values, **self.free.to_constrained(jnp.asarray(u))}
        return force_rows(self.plant, p, self.motion, names)

    def linear_rows(
        self, likelihood: RowLikelihood, u: Float[Array, " n"], warm_start: None, predicted: None = None
    ) -> LinearRows:
        """Rows and slopes at ``u``; the motion is known, so that nothing is started from."""
        del likelihood
        found = self.force(u, self.free.names)
        slopes = found.slopes * np.asarray(self.free.jacobian_diag(jnp.asarray(u)))
        return LinearRows(found.rows, slopes, None, found.status)

    def refined(self, u: Float[Array, " n"], warm_start: None) -> None:
        """Nothing: the motion is known."""
        return

    def with_background(
        self, likelihood: RowLikelihood, at: LinearisationPoint, drifting: Sequence[str]
    ) -> tuple["SampledForce", RowLikelihood, Data]:
        """As it is: functions of the motion would stand for the very friction that is to be identified by it.

        Every row errs by itself, as in a diagnosis along a motion.
        """
        return self, likelihood, likelihood.data

    def exact(self, likelihood: RowLikelihood, u: Float[Array, " n"], warm_start: None) -> "ExactForce":
        """The model, which is as exact anywhere."""
        return ExactForce(self, likelihood)


@dataclass(frozen=True)
class ExactForce:
    """The force that a model needs along a measured motion, at several points."""

    problem: SampledForce
    likelihood: RowLikelihood

    def rows(self, us: Float[np.ndarray, "W n"]) -> tuple[Float[np.ndarray, "W m"], np.ndarray]:
        """Force [N] at several sets of free coordinates, (W, m), and whether the states were found, (W,)."""
        found = in_parallel(lambda u: self.problem.force(jnp.asarray(u)), us)
        solved = np.array([each.status.ok and bool(np.isfinite(each.rows).all()) for each in found])
        return np.stack([each.rows for each in found]), solved

    def predicted(self, u: Float[Array, " n"]) -> None:
        """Nothing is started from."""
        return


NOISE_TRUST = 0.01
"""Standard deviation of the logarithm of the noise scale [1].

Rows of a force are all alike, so that more noise and a larger discrepancy do the same to them: what is beyond the
noise of thousands of rows is discrepancy.
"""


def _likelihood_of(data: Data) -> RowLikelihood:
    return RowLikelihood(
        measured=jnp.asarray(data.measured),
        variance=jnp.asarray(data.variance),
        discrepancy_scale=jnp.asarray(data.discrepancy_scale),
        scales=data.scales._replace(noise_trust=NOISE_TRUST),
    )


@dataclass(frozen=True)
class MotionQuestion:
    """What is asked of a measured motion.

    Attributes:
        motion: what was measured.
        model: the model as known before the data, its forces as large as the recorded one asks for.
        values: where to look for the mode: identified values by name, SI; the model's own where left out.
        free: names of the parameters that the data alone identify.
    """

    motion: DrivenMotion
    model: Model
    values: Mapping[str, float]
    free: tuple[str, ...]

    @property
    def marks(self) -> Mapping[str, object]:
        """What the data are, by which a chain is recognised."""
        motion = self.motion
        return {
            "position": motion.position,
            "drive": motion.drive,
            "time_scale": motion.time_scale,
            **{f"beside {name}": each for name, each in motion.beside.items()},
            "step": motion.step,
            "noise": motion.noise,
        }

    def posed(self, settings: SamplingSettings) -> "PosedMotion":
        """The question with what is sampled."""
        return PosedMotion(self, settings)


@dataclass(frozen=True)
class PosedMotion:
    """A question about a measured motion with what is sampled."""

    question: MotionQuestion
    settings: SamplingSettings

    @cached_property
    def density(self) -> PosteriorDensity:
        """Of its posterior, without a background of small errors.

        Raises :class:`InputError` for names that do not exist or that the model does not use.
        """
        asked = self.question
        table, plant = asked.model.table, asked.model.build()
        used = used_parameters(plant, table)
        check_free(asked.free, table, used)
        known = [] if self.settings.fixed_tolerances else known_to_tolerance(table, asked.free)
        free = FreeVector(table, asked.free, tuple(name for name in known if name in used))
        data = force_data(asked.motion)
        problem = SampledForce(plant, as_values(table.as_dict()), asked.motion, free)
        return PosteriorDensity(problem, _likelihood_of(data), Prior(free))

    def mode(self, report: Progress) -> PosteriorMode:
        """That of this density; raises :class:`InputError` if the states along the motion are not found."""
        report("finding the force that the model needs")
        start = self.question.model.table.as_dict() | dict(self.question.values)
        mode = find_mode(self.density, self.density.problem.free.to_unconstrained(start), None, report)
        if not mode.solved:
            raise InputError(
                "the states of the model along the motion are not found at these parameters",
                remedy="identify it first: savgs-ident fit",
            )
        return mode

    def answer(self, exact: ExactForce, chains: Chains, answer: Mapping[str, Any]) -> MotionPosterior:
        """The posterior, of which the ``answer`` has what is not of the force."""
        measured = force_data(self.question.motion).measured
        predicted = predict_force(exact, chains, self.settings.predictive_draws, self.settings.seed)
        return MotionPosterior(predictive=predicted, motion=self.question.motion, measured=measured, **answer)


def predict_force(exact: ExactForce, chains: Chains, count: int, seed: int) -> PredictedForce:
    """The prediction at ``count`` draws, evenly spaced along the chains; unsolved ones are left out."""
    flat = chains.points.reshape(-1, chains.points.shape[-1])
    points = flat[np.unique(np.linspace(0, len(flat) - 1, count).astype(int))]
    force, solved = exact.rows(points[:, :-2])
    points, model = points[solved], force[solved]
    likelihood = exact.likelihood
    spread = np.asarray(jax.vmap(likelihood.spread)(jnp.asarray(points)))
    replicated = model + np.random.default_rng(seed).standard_normal(spread.shape) * np.sqrt(spread)
    low, high = np.quantile(replicated, WITHIN, axis=0)
    measured = np.asarray(likelihood.measured)
    return PredictedForce(model, replicated, (low <= measured) & (measured <= high))
