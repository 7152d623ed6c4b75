"""What the plate under the tyre does: still, a steady cam, a sweep, or a recorded or tabulated height.

road = cam_road(peak_to_peak=0.0275, frequency=2.35, settle=1.0)
road.height(t), road.velocity(t)
"""

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import SupportsFloat

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.typing import ArrayLike

from savgs_ident.core.errors import InputError
from savgs_ident.effects.base import Fundamental
from savgs_ident.plants.base import Excitation
from savgs_ident.plants.profiles import AbstractProfile, Constant, LinearSweep, Sine, SweptAngle, tabulated
from savgs_ident.plants.quarter_car.tyre import Road
from savgs_ident.recordings.recording import Recording


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


def cam_road(peak_to_peak: float, frequency: float, settle: float = 0.0) -> RoadMotion:
    """A cam of height ``peak_to_peak`` [m] at ``frequency`` [Hz], highest at t = 0.

    Its lift grows smoothly from nothing during the first ``settle`` [s].
    """
    angle = SweptAngle(frequency, frequency, 1.0, 0.0)
    return RoadMotion(Sine(peak_to_peak / 2.0, frequency, 0.0, 0.0, settle), angle)


def sweep_road(peak_to_peak: float, start: float, end: float, duration: float) -> RoadMotion:
    """A cam [m] whose frequency runs from ``start`` to ``end`` [Hz] in ``duration`` [s], upwards first."""
    angle = SweptAngle(start, end, duration, -np.pi / 2.0)
    return RoadMotion(LinearSweep(peak_to_peak / 2.0, start, end, duration), angle)


def tabulated_road(time: ArrayLike, height: ArrayLike, source: str = "") -> RoadMotion:
    """A height [m], (n,), given at times [s], (n,), with a C1 curve between.

    Raises :class:`InputError` as :func:`savgs_ident.plants.profiles.tabulated` does.
    """
    return RoadMotion(tabulated(time, height, source))


def recorded_road(recording: Recording) -> RoadMotion:
    """The road of a recorded test. Raises :class:`InputError` if none was recorded."""
    if "road_height" not in recording.channels:
        raise InputError(
            "the road was not recorded",
            test=recording.name,
            channel="road_height",
            remedy="choose a test with the road's height",
        )
    channel = recording.channels["road_height"]
    return tabulated_road(channel.time, channel.values, channel.source)


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
    return tabulated_road(table[:, 0], table[:, 1], str(path))
