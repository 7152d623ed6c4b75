"""What drives the rig over time: a road, and what moves the single link.

The link follows a motion imposed from outside, or a drive with states of its own. Either gives the link's angle and
velocity from its state, and the state's rates under the torque with which the strut turns the link.
"""

from abc import abstractmethod

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float
from numpy.typing import ArrayLike

from savgs_ident.core.errors import InputError
from savgs_ident.core.values import Values
from savgs_ident.plants.base import AbstractSource
from savgs_ident.plants.profiles import AbstractProfile, Constant, Sine, tabulated
from savgs_ident.plants.quarter_car.plant import Loads, QuarterCar
from savgs_ident.plants.quarter_car.road import RoadMotion
from savgs_ident.plants.quarter_car.strut import Link
from savgs_ident.plants.quarter_car.tyre import Inputs, Road
from savgs_ident.recordings.recording import Recording

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


def held_link(angle: float) -> ImposedLink:
    """A rigid link at ``angle`` [rad]."""
    return ImposedLink(Constant(angle))


def harmonic_link(mean: float, amplitude: float, frequency: float, settle: float = 0.0) -> ImposedLink:
    """A link that swings about ``mean`` [rad] by ``amplitude`` [rad] at ``frequency`` [Hz], growing smoothly.

    The swing is at its greatest angle at t = 0, and grows from nothing during the first ``settle`` [s].
    """
    return ImposedLink(Sine(amplitude, frequency, mean, 0.0, settle))


def tabulated_link(time: ArrayLike, angle: ArrayLike, source: str = "") -> ImposedLink:
    """A link angle [rad], (n,), given at times [s], (n,), with a C1 curve between.

    Raises :class:`InputError` as :func:`savgs_ident.plants.profiles.tabulated` does.
    """
    return ImposedLink(tabulated(time, angle, source))


def recorded_link(recording: Recording) -> ImposedLink:
    """The link's motion in a recorded test. Raises :class:`InputError` if it was not recorded."""
    if "link_angle" not in recording.channels:
        raise InputError(
            "the link angle was not recorded",
            test=recording.name,
            channel="link_angle",
            remedy="hold the link at its nominal angle instead",
        )
    channel = recording.channels["link_angle"]
    return tabulated_link(channel.time, channel.values, channel.source)


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
