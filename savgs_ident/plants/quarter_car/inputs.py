"""What drives the rig over time: a road, and what moves the single link.

The road is the plate under the tyre: still, on a steady cam, in a sweep, or at a tabulated height.

    road = cam_road(peak_to_peak=0.0275, frequency=2.35, rise_time=1.0)
    road.height(t), road.velocity(t)

The link follows a motion imposed from outside, or a drive with states of its own. Either gives the link's angle and
velocity from its state, and the state's rates under the torque with which the strut turns the link.
"""

import warnings
from abc import abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import SupportsFloat

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.typing import ArrayLike

from savgs_ident.core.errors import InputError
from savgs_ident.core.values import Values
from savgs_ident.effects.base import Fundamental
from savgs_ident.plants.base import AbstractSource, Excitation
from savgs_ident.plants.profiles import (
    AbstractProfile,
    Constant,
    LinearSweep,
    Number,
    Sine,
    SweptAngle,
    tabulated,
)
from savgs_ident.plants.quarter_car.forces import Inputs, Link, Road
from savgs_ident.plants.quarter_car.plant import Loads, QuarterCar


class RoadMotion(eqx.Module):
    """The plate's height over time, ``profile`` in [m], up positive, 0 at standstill.

    ``turning`` is the angle of the cam behind it [rad], if there is one.
    """

    profile: AbstractProfile
    turning: AbstractProfile | None = None

    def height(self, t: Float[Array, ""]) -> Float[Array, ""]:
        """Height of the plate [m] at time ``t`` [s]."""
        return self.profile.value(t)

    def velocity(self, t: Float[Array, ""]) -> Float[Array, ""]:
        """Its velocity [m/s]."""
        return self.profile.rate(t)

    def at(self, t: Float[Array, ""]) -> Road:
        """Height and velocity at time ``t`` [s], as the model takes them."""
        return Road(self.height(t), self.velocity(t))

    def cam_at(self, t: Float[Array, ""]) -> Fundamental | None:
        """Angle and speed of the cam at time ``t`` [s]; None if nothing turns."""
        return None if self.turning is None else Fundamental(self.turning.value(t), self.turning.rate(t))


def nominal_test(p: Mapping[str, SupportsFloat]) -> tuple[float, float]:
    """Lift of the cam [m], peak to peak, and the angle [rad] at which the link is held, from the parameters."""
    return float(p["cam_peak_to_peak"]), float(p["psi_nominal"])


def cam_excitation(frequency: ArrayLike, peak_to_peak: float, link_angle: float) -> Excitation:
    """A cam of height ``peak_to_peak`` [m] at ``frequency`` [Hz], (D,), with a rigid link [rad]."""
    frequency = np.atleast_1d(np.asarray(frequency, dtype=np.float64))
    road = np.zeros((frequency.size, 2), dtype=np.complex128)
    road[:, 1] = peak_to_peak / 2.0
    link = np.full((frequency.size, 1), link_angle, dtype=np.complex128)
    harmonics = {"road_height": jnp.asarray(road), "link_angle": jnp.asarray(link)}
    return Excitation(jnp.asarray(frequency), harmonics)


def flat_road() -> RoadMotion:
    """A plate that stands still."""
    return RoadMotion(Constant(0.0))


def cam_road(peak_to_peak: Number, frequency: Number, rise_time: Number = 0.0) -> RoadMotion:
    """A cam of height ``peak_to_peak`` [m] at ``frequency`` [Hz], highest at t = 0.

    Its lift grows smoothly from nothing during the first ``rise_time`` [s].
    """
    angle = SweptAngle(frequency, frequency, 1.0, 0.0)
    return RoadMotion(Sine(peak_to_peak / 2.0, frequency, 0.0, 0.0, rise_time), angle)


def sweep_road(peak_to_peak: float, start: float, end: float, duration: float) -> RoadMotion:
    """A cam [m] whose frequency runs from ``start`` to ``end`` [Hz] in ``duration`` [s], upwards first."""
    angle = SweptAngle(start, end, duration, -np.pi / 2.0)
    return RoadMotion(LinearSweep(peak_to_peak / 2.0, start, end, duration), angle)


def read_road(path: Path | str) -> RoadMotion:
    """A road from a text file of two columns, time [s] and height [m], split by commas, with one header line.

    Raises :class:`InputError` if the file cannot be read or is no such table.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", UserWarning)
            table = np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2)
    except (OSError, ValueError, UserWarning) as error:
        raise InputError(
            f"is not a readable road: {error}", source=path, remedy="give a header and rows of time, height"
        ) from error
    if table.shape[1] != 2:
        raise InputError(
            f"has {table.shape[1]} columns", source=path, remedy="give two: time [s] and height [m]"
        )
    return RoadMotion(tabulated(table[:, 0], table[:, 1], str(path)))


Scalar = Float[Array, ""]


class AbstractActuation(eqx.Module):
    """How the link moves; ``scales`` are the typical sizes of its states, in their units, for tolerances."""

    scales: eqx.AbstractClassVar[tuple[float, ...]]

    @abstractmethod
    def start_angle(self, t: Scalar) -> Scalar:
        """Link angle [rad] at which a motion that begins at rest at time ``t`` [s] begins."""

    @abstractmethod
    def start(self, p: Values, t: Scalar, load: Scalar) -> Float[Array, " k"]:
        """State in which the link rests there against a ``load`` [N m]."""

    @abstractmethod
    def link(self, t: Scalar, state: Float[Array, " k"]) -> Link:
        """The link's angle [rad] and velocity [rad/s] at time ``t`` [s], from the states (k,) of what moves it."""

    @abstractmethod
    def rate(self, p: Values, t: Scalar, state: Float[Array, " k"], load: Scalar) -> Float[Array, " k"]:
        """Time derivatives of the state; ``load`` [N m] turns the link towards greater angles."""


class ImposedLink(AbstractActuation):
    """A link whose angle [rad] follows ``profile`` whatever the load."""

    profile: AbstractProfile
    scales = ()

    def start_angle(self, t: Scalar) -> Scalar:
        """The imposed angle."""
        return self.profile.value(t)

    def start(self, p: Values, t: Scalar, load: Scalar) -> Float[Array, " k"]:
        """Nothing: there is no state."""
        return jnp.zeros(0)

    def link(self, t: Scalar, state: Float[Array, " k"]) -> Link:
        """The imposed angle and velocity."""
        return Link(self.profile.value(t), self.profile.rate(t))

    def rate(self, p: Values, t: Scalar, state: Float[Array, " k"], load: Scalar) -> Float[Array, " k"]:
        """Nothing: there is no state."""
        return jnp.zeros(0)


def held_link(angle: Number) -> ImposedLink:
    """A rigid link at ``angle`` [rad]."""
    return ImposedLink(Constant(angle))


class RigSource(AbstractSource):
    """A road and what moves the link, as the source of a simulation."""

    road: RoadMotion
    link: AbstractActuation

    @property
    def scales(self) -> tuple[float, ...]:
        """Typical sizes of the states of what moves the link."""
        return self.link.scales

    def at_rest(self, plant: QuarterCar, t: Scalar) -> Inputs:
        """Road and link as they stand at time ``t`` [s]."""
        zero = jnp.zeros_like(t)
        return Inputs(Road(self.road.height(t), zero), Link(self.link.start_angle(t), zero))

    def start(self, p: Values, t: Scalar, loads: Loads) -> Float[Array, " k"]:
        """State of what moves the link, at rest against the strut's torque."""
        return self.link.start(p, t, loads.link_torque)

    def inputs(self, plant: QuarterCar, t: Scalar, state: Float[Array, " k"]) -> Inputs:
        """Road, link and cam at time ``t`` [s]."""
        return Inputs(self.road.at(t), self.link.link(t, state), self.road.cam_at(t))

    def rate(self, p: Values, t: Scalar, state: Float[Array, " k"], loads: Loads) -> Float[Array, " k"]:
        """Rates of the states of what moves the link under the strut's torque."""
        return self.link.rate(p, t, state, loads.link_torque)
