"""The fit of a plant along a measured motion: the parameters with which it needs the force that its drive exerted.

    fit = fit_along_motion(model, motion, free=("mass", "viscous_friction"))
    fit["mass"].value, fit["mass"].stderr

The motion hides under closed loop what a model lacks; the force shows it. Every row of force is weighed by its noise.
What the model leaves beyond that is in the errors of the parameters as in a fit of harmonics: all of it may lie along
a parameter (:func:`savgs_ident.fit.identifiability.weighed_by_misfit`).
"""

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.free_vector import known_to_tolerance
from savgs_ident.core.presentation import NO_ORIGIN, Origin, Progress, Result, no_progress
from savgs_ident.core.status import Status, joint_status
from savgs_ident.core.values import as_values
from savgs_ident.fit.estimate import Estimate, at_bounds
from savgs_ident.fit.identifiability import (
    EXPLAINED,
    INFORMED,
    MATERIAL_MISFIT,
    unexplained,
    verdict_of,
    widened_by_misfit,
)
from savgs_ident.fit.identified import Identified, Verdict
from savgs_ident.fit.small_errors import own_part
from savgs_ident.inference.drive_force import (
    DriveForce,
    force_data,
    force_rows,
    relative_miss,
    relative_noise,
)
from savgs_ident.inference.find_map import find_map
from savgs_ident.inference.laplace import spread_of
from savgs_ident.inference.laplace_fit import LaplaceFit, search_of
from savgs_ident.inference.likely_mistake import mistaken_drive
from savgs_ident.inference.prior import sheet_coordinate, slopes_at
from savgs_ident.inference.problem import check_free, used_parameters
from savgs_ident.plants.model import Model
from savgs_ident.responses.driven_motion import DrivenMotion
from savgs_ident.simulate.driven_plant import sized_along
from savgs_ident.simulate.public import disable_effects


class HeldOutForce(NamedTuple):
    """Another motion that nothing was fitted to: its file, and by how much its force is missed [1].

    ``as_given`` before the fit, ``identified`` with the estimated values, ``noise`` by the noise alone; NaN where
    the model has no solution along it.
    """

    source: str
    as_given: float
    identified: float
    noise: float


@dataclass(frozen=True)
class MotionFit(Identified):
    """A finished fit along a measured motion of m rows.

    Attributes:
        motion: what was measured.
        measured: force of the drive, low-passed and thinned [N], (m,).
        as_given: force that the model needs before the fit [N], (m,).
        predicted: force that the identified model needs [N], (m,).
        held_out: another motion, predicted; None where there is none.
    """

    presenter: ClassVar[str] = "MOTION_FIT"

    motion: DrivenMotion
    measured: NDArray[np.float64]
    as_given: NDArray[np.float64]
    predicted: NDArray[np.float64]
    held_out: HeldOutForce | None = None

    @property
    def unsolved(self) -> str:
        """Nowhere: that states were not found is in the status."""
        return ""

    @property
    def mistaken(self) -> str:
        """Whether the drive's force goes the other way than the model says, in words."""
        return mistaken_drive(self.measured, self.as_given, self.estimated.plant)

    @property
    def compared(self) -> Mapping[str, object]:
        """The force of the drive."""
        return {"quantity": "force of the drive"}

    @property
    def gap(self) -> tuple[float, float, float]:
        """Relative rms [1] by which the force is missed before the fit and after, and that of the noise alone."""
        before, after = (relative_miss(self.measured, rows) for rows in (self.as_given, self.predicted))
        return before, after, relative_noise(self.motion)


@dataclass(frozen=True)
class MotionComparison(Result):
    """The force of a drive along a measured motion of m rows, and what a model, and the same without effects, need.

    Attributes:
        model: the model.
        motion: what was measured.
        measured: force of the drive, low-passed and thinned [N], (m,).
        needed: force that the model needs [N], (m,).
        frictionless: that without its effects [N], (m,).
        status: how the states along the motion were found.
    """

    presenter: ClassVar[str] = "MOTION_COMPARISON"

    model: Model
    motion: DrivenMotion
    measured: NDArray[np.float64]
    needed: NDArray[np.float64]
    frictionless: NDArray[np.float64]
    status: Status

    @property
    def trusted(self) -> bool:
        """Whether the states were found."""
        return self.status.ok


def compare_along_motion(model: Model, motion: DrivenMotion, origin: Origin = NO_ORIGIN) -> MotionComparison:
    """Hold a model against the force of its drive along a measured motion; nothing is fitted."""
    found, without = (
        force_rows(each.build(), as_values(each.table.as_dict()), motion, ())
        for each in (model, disable_effects(model))
    )
    status = joint_status([found.status, without.status])
    measured = motion.rows(motion.drive)
    return MotionComparison(model, motion, measured, found.rows, without.rows, status, origin=origin)


def fit_along_motion(
    model: Model,
    motion: DrivenMotion,
    *,
    free: tuple[str, ...],
    fixed_tolerances: bool = False,
    held_out: DrivenMotion | None = None,
    origin: Origin = NO_ORIGIN,
    progress: Progress = no_progress,
) -> MotionFit:
    """Fit ``free`` parameters of a model with one coordinate to the force of its drive.

    What is known to a tolerance is estimated along, unless ``fixed_tolerances``. ``held_out`` is predicted, and
    compared. Look at ``trusted`` of the result. Raises :class:`InputError` for names that do not exist or that the
    model does not use, and for a plant that is not held against its drive.
    """
    began = time.perf_counter()
    model = sized_along(model, motion)
    table, plant = model.table, model.build()
    used = used_parameters(plant, table)
    check_free(free, table, used)
    tolerated = () if fixed_tolerances else tuple(n for n in known_to_tolerance(table, free) if n in used)
    coordinates = tuple(sheet_coordinate(table[name]) for name in (*free, *tolerated))
    problem, data = DriveForce(plant, table, motion, coordinates), force_data(motion)
    progress("finding the force that the model needs as given")
    as_given = problem.predict((), {}, (), None).rows
    mode = find_map(search_of(problem, data), (), {}, None, progress=progress)
    predicted = mode.prediction.rows
    residual = (data.measured - predicted) / motion.noise
    chi2, dof = float(residual @ residual), data.measured.size - len(free)
    estimates, covariance = _estimates(mode, model, free, chi2, motion.noise)
    ended = at_bounds((table[name] for name in free), mode.values)
    verdict = _verdict(estimates, covariance, ended, chi2, dof, relative_miss(data.measured, predicted))
    apart = None if held_out is None else _apart(problem, held_out, mode)
    return MotionFit(
        estimated=model.with_values({each.name: each.value for each in estimates}),
        estimates=estimates,
        covariance=covariance,
        chi2=chi2,
        dof=dof,
        status=mode.status,
        verdict=verdict,
        wall_s=time.perf_counter() - began,
        motion=motion,
        measured=data.measured,
        as_given=as_given,
        predicted=predicted,
        held_out=apart,
        origin=origin,
    )


def _estimates(
    mode: LaplaceFit, model: Model, free: tuple[str, ...], chi2: float, noise: float
) -> tuple[tuple[Estimate, ...], NDArray[np.float64]]:
    """The estimates, free ones first, and their covariance [products of their units]."""
    coordinates, rows = mode.coordinates, mode.slopes.shape[0]
    priors = np.eye(len(coordinates))
    scaled, alone = (
        spread_of(np.concatenate([mode.slopes / noise / size, priors]))
        for size in (widened_by_misfit(chi2, rows - len(free)), 1.0)
    )
    known = np.array([model.table[each.name].has_prior for each in coordinates])
    own = np.sqrt(np.diag(own_part(alone.covariance, np.where(known, 1.0, np.inf))))
    slope = slopes_at(coordinates, mode.x)
    estimates = []
    for place, each in enumerate(coordinates):
        before = model.table[each.name]
        informed = scaled.sd[place] < INFORMED or each.name not in free
        unit = abs(slope[place]) if informed else np.inf
        estimates.append(
            Estimate(
                name=each.name,
                value=mode.values[each.name],
                stderr=float(unit * scaled.sd[place]),
                own_stderr=float(unit * own[place]),
                unit=before.unit,
                free=each.name in free,
                prior=before.value,
                prior_sd=0.0 if before.is_typical else before.tolerance,
            )
        )
    return tuple(estimates), scaled.covariance * np.outer(slope, slope)


def _verdict(
    estimates: tuple[Estimate, ...],
    covariance: NDArray[np.float64],
    ended: Mapping[str, str],
    chi2: float,
    dof: int,
    missed: float,
) -> Verdict:
    """What the data say of the free parameters, where the model explains them."""
    per_datum = chi2 / max(dof, 1)
    beyond = missed * float(np.sqrt(max(1.0 - 1.0 / max(per_datum, 1.0), 0.0)))
    if per_datum > EXPLAINED and beyond > MATERIAL_MISFIT:
        return Verdict(False, (unexplained(per_datum, beyond), *ended.values()), explained=False)
    free = [each for each in estimates if each.free]
    names, values = tuple(each.name for each in free), np.array([each.value for each in free])
    logarithms = covariance[: len(free), : len(free)] / np.outer(values, values)
    return verdict_of(
        names,
        dict(zip(names, values.tolist(), strict=True)),
        {each.name: each.unit for each in estimates},
        logarithms,
        {},
        (),
        ended,
    )


def _apart(problem: DriveForce, motion: DrivenMotion, mode: LaplaceFit) -> HeldOutForce:
    """How a motion that nothing was fitted to is predicted."""
    there = DriveForce(problem.model, problem.table, motion, problem.nuisances)
    measured = motion.rows(motion.drive)
    found = [there.predict((), values, (), None) for values in ({}, mode.values)]
    before, after = (relative_miss(measured, each.rows) if each.solved else np.nan for each in found)
    return HeldOutForce(motion.source, before, after, relative_noise(motion))
