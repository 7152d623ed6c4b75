"""The linear models of a rig side by side, and against the nonlinear one.

Three questions, one record each: how k_eq, c_eq and alpha change with the link angle, and how well constants and
parabolas approximate them (Fig. 7); how far equation (8) and the exact linearisation are from the nonlinear rig at
small motions, and why; how far the rig with describing functions is from it at the amplitude of the test.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import ArrayLike, NDArray

from savgs_ident.control.linear_equivalent import (
    Equivalent,
    TwoMasses,
    equivalents,
    nominal_equivalent,
    paper_masses,
    quarter_car_space,
    resting_angles,
    with_damper_at_rest,
    with_distributed_masses,
)
from savgs_ident.control.linearisation import (
    DescribingFunctions,
    describe,
    first_harmonic,
    linearise,
    motions_on_cam,
    quasi_linear_response,
)
from savgs_ident.core.errors import InputError
from savgs_ident.core.presentation import Origin, Progress, Result
from savgs_ident.core.values import Values, as_values
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.simulate.linearisation import nominal_rest

CHANNELS = ("sprung_accel", "susp_deflection")
"""[m/s^2] and [m], per metre of road."""
LINK_DEG = np.linspace(0.0, 180.0, 181)
"""Link angles of the curves [deg]."""
WISHBONE_DEG = np.linspace(-10.0, 10.0, 21)
"""Wishbone angles of the surfaces [deg]."""
WORKING_DEG = (40.0, 140.0)
"""Working range of the link in a closed loop [deg], where a second parabola is fitted."""
SMALL = 2e-6
"""Peak to peak of a small cam [m]; at 0.1 mm the curvature of the damper alone causes 1.6 %."""
FREQUENCY = np.geomspace(0.5, 10.0, 41)
"""Frequencies of the small motions [Hz]."""
TEST_FREQUENCY = np.array([0.5, 1.0, 1.5, 1.75, 2.0, 2.2, 2.35, 2.5, 2.75, 3.0, 3.5, 4.0, 5.0, 6.0])
"""Frequencies of the motions at the size of the test [Hz]."""
EXACT = 0.01
"""Largest relative error of the exact linearisation at small motions [1]."""
Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class Approximation:
    """A polynomial in the link angle, with its residual.

    Attributes:
        coefficients: powers of the link angle [rad], constant first, in the quantity's unit.
        rms: root mean square of the residual over the greatest magnitude of the quantity [1].
        largest: the largest residual over the same magnitude [1].
    """

    coefficients: tuple[float, ...]
    rms: float
    largest: float

    def __call__(self, angle: ArrayLike) -> NDArray[np.float64]:
        """The approximated quantity at link angles [rad], any shape; the result has the same."""
        return np.asarray(Polynomial(self.coefficients)(np.asarray(angle, dtype=np.float64)))


def approximate(angle: NDArray[np.float64], values: NDArray[np.float64], degree: int) -> Approximation:
    """The least-squares polynomial of a ``degree`` through ``values`` (n,) at link angles (n,) [rad]."""
    polynomial = Polynomial.fit(angle, values, degree).convert()
    residual = np.abs(values - polynomial(angle)) / np.max(np.abs(values))
    return Approximation(
        tuple(float(c) for c in polynomial.coef),
        float(np.sqrt(np.mean(residual**2))),
        float(np.max(residual)),
    )


@dataclass(frozen=True)
class EquivalentStudy:
    """k_eq [N/m], c_eq [N s/m], alpha [m/rad] over the link angle, the rig at rest, and over both angles.

    Attributes:
        link_deg: link angles [deg], (n,).
        wishbone_deg: static equilibrium of the wishbone there [deg], (n,).
        resting: the equivalent along them, each (n,).
        surface: the equivalent over link angles and :data:`WISHBONE_DEG`, each (n, m).
        nominal: the equivalent in the nominal state.
        approximations: by the name of the quantity and of the approximation.
    """

    link_deg: NDArray[np.float64]
    wishbone_deg: NDArray[np.float64]
    resting: Equivalent
    surface: Equivalent
    nominal: Equivalent
    approximations: Mapping[str, Approximation]


@dataclass(frozen=True)
class SmallMotions:
    """Responses to a small cam, complex (F, 2), :data:`CHANNELS` per metre of road [unit/m].

    Attributes:
        frequency: [Hz], (F,).
        nonlinear: the nonlinear rig without friction.
        models: the linear models by name, each with one simplification less.
        masses: the parameters of those with two masses.
        slow_link: suspension deflection per z_lin of a link that turns slowly [1], by the exact linearisation; 1 in
            equation (8).
    """

    frequency: NDArray[np.float64]
    nonlinear: Complex
    models: Mapping[str, Complex]
    masses: Mapping[str, TwoMasses]
    slow_link: float

    def error(self, name: str) -> float:
        """Largest relative difference of a model to the nonlinear rig over frequencies and channels [1]."""
        return float(np.max(np.abs(self.models[name] / self.nonlinear - 1.0)))


@dataclass(frozen=True)
class CamMotions:
    """Responses to the cam of the test [unit/m], (D, 2), friction included.

    Attributes:
        nonlinear: complex (D, 2), first harmonics of the nonlinear rig per metre of road.
        quasi_linear: the same of the rig with describing functions.
        described: the gains.
    """

    nonlinear: Complex
    quasi_linear: Complex
    described: DescribingFunctions

    @property
    def error(self) -> float:
        """Largest relative difference over frequencies and channels [1]."""
        return float(np.max(np.abs(self.quasi_linear / self.nonlinear - 1.0)))


@dataclass(frozen=True)
class LinearStudy(Result):
    """All three studies of a ``model``; ``at_test`` is None for a rig without friction."""

    presenter: ClassVar[str] = "LINEAR_STUDY"

    model: RigModel
    equivalents: EquivalentStudy
    small: SmallMotions
    at_test: CamMotions | None

    @property
    def trusted(self) -> bool:
        """Whether the exact linearisation agrees with the nonlinear rig at small motions, as it must."""
        return self.small.error("exact linearisation") <= EXACT


def study_linear(model: RigModel, origin: Origin, progress: Progress) -> LinearStudy:
    """All three studies. Raises :class:`InputError` where the rig has no static equilibrium or no periodic motion."""
    plant, p = model.build(), as_values(model.table.as_dict())
    progress("linear equivalent over the link angle")
    over_angles = study_equivalents(plant, p)
    progress("small motions: equation (8), exact linearisation, nonlinear rig")
    small = study_small_motions(plant, p)
    if not plant.effects:
        return LinearStudy(model, over_angles, small, None, origin=origin)
    progress("motions of the test: describing functions, nonlinear rig")
    return LinearStudy(model, over_angles, small, study_test_motions(plant, p), origin=origin)


def study_equivalents(model: QuarterCar, p: Values) -> EquivalentStudy:
    """The linear equivalent over the angles."""
    bare, rig = QuarterCar(model.damper), model.effective(p)
    link, wishbone = np.radians(LINK_DEG), np.radians(WISHBONE_DEG)
    rest, root = resting_angles(bare, rig, jnp.asarray(link))
    if not root.status().ok:
        raise InputError(
            "the rig finds no rest at some link angle", remedy="mend the spring or the hardpoints of the rig"
        )
    along = _plain(equivalents(bare, rig, rest, jnp.asarray(link)))
    pairs = np.meshgrid(wishbone, link)
    surface = equivalents(bare, rig, *(jnp.asarray(each.ravel()) for each in pairs))
    shape = (link.size, wishbone.size)
    lowest, highest = WORKING_DEG
    works = (lowest <= LINK_DEG) & (highest >= LINK_DEG)
    approximations = {
        f"{name} by a constant": approximate(link, getattr(along, name), 0)
        for name in ("k_eq", "c_eq", "alpha")
    }
    approximations["alpha by a parabola"] = approximate(link, np.asarray(along.alpha), 2)
    approximations["alpha by a parabola, working range"] = approximate(
        link[works], np.asarray(along.alpha)[works], 2
    )
    return EquivalentStudy(
        LINK_DEG,
        np.degrees(np.asarray(rest)),
        along,
        _plain(Equivalent(*(part.reshape(shape) for part in surface))),
        _plain(nominal_equivalent(model, p)),
        approximations,
    )


def _plain(found: Equivalent) -> Equivalent:
    numbers: Equivalent = jax.tree.map(np.asarray, found)
    return numbers


def study_small_motions(model: QuarterCar, p: Values) -> SmallMotions:
    """The linear models and the nonlinear rig on a small cam, without friction."""
    bare, rig = QuarterCar(model.damper), model.effective(p)
    printed = paper_masses(model, p)
    at_rest = with_damper_at_rest(model, p, printed)
    masses = {
        "equation (8)": printed,
        "(8), damper's slope at rest": at_rest,
        "(8), masses distributed, too": with_distributed_masses(model, p, at_rest),
    }
    iw = 2j * np.pi * FREQUENCY
    models = {}
    for name, numbers in masses.items():
        response = quarter_car_space(numbers)(iw)
        models[name] = np.stack([response[0, 0], response[1, 0]], axis=-1) * iw[:, None]
    exact = linearise(bare, rig, nominal_rest(bare, rig))
    found = exact(iw)
    seen = np.array([float(rig["accel_gain"]), float(rig["deflection_gain"])])
    models["exact linearisation"] = np.stack([found[0, 0], found[1, 0]], axis=-1) * iw[:, None]
    motions = motions_on_cam(bare, rig, FREQUENCY, SMALL)
    nonlinear = first_harmonic(bare, rig, motions, SMALL) / seen
    slow = 2j * np.pi * 1e-3
    turned = exact(slow)[1, 1] * slow / float(nominal_equivalent(model, p).alpha)
    return SmallMotions(FREQUENCY, nonlinear, models, masses, float(np.real(turned)))


def study_test_motions(model: QuarterCar, p: Values) -> CamMotions:
    """The rig with describing functions and the nonlinear one on the cam of the test."""
    cam = float(p["cam_peak_to_peak"])
    motions = motions_on_cam(model, p, TEST_FREQUENCY, cam)
    described, nonlinear = describe(model, p, motions), first_harmonic(model, p, motions, cam)
    return CamMotions(nonlinear, quasi_linear_response(model, p, described), described)
