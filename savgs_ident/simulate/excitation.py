"""What drives the rig in a dwell: harmonics of the road and of the link angle at a frequency."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float
from numpy.typing import ArrayLike

from savgs_ident.model.effect import Cam
from savgs_ident.model.inputs import Inputs
from savgs_ident.model.strut import Link
from savgs_ident.model.tyre import Road
from savgs_ident.simulate.mesh import Mesh, turns


class Excitation(NamedTuple):
    """Inputs of D dwells as complex harmonics, x(t) = X_0 + Re sum_k X_k exp(2 pi i k f t).

    Attributes:
        frequency: fundamental [Hz], (D,).
        road: harmonics of the plate's height [m], (D, R + 1).
        link: harmonics of the link angle [rad], (D, L + 1).
    """

    frequency: Float[Array, " D"]
    road: Complex[Array, "D R"]
    link: Complex[Array, "D L"]


def cam_excitation(frequency: ArrayLike, peak_to_peak: float, link_angle: float) -> Excitation:
    """A cam of height ``peak_to_peak`` [m] at ``frequency`` [Hz], (D,), with a rigid link [rad]."""
    frequency = np.atleast_1d(np.asarray(frequency, dtype=np.float64))
    road = np.zeros((frequency.size, 2), dtype=np.complex128)
    road[:, 1] = peak_to_peak / 2.0
    link = np.full((frequency.size, 1), link_angle, dtype=np.complex128)
    return Excitation(jnp.asarray(frequency), jnp.asarray(road), jnp.asarray(link))


def _synthesise(harmonics: Array, omega: Array, phase: Array) -> tuple[Array, Array]:
    """Value and time derivative at the nodes, both (P,), from harmonics (P, K)."""
    order = jnp.arange(harmonics.shape[1])
    terms = harmonics * turns(phase, harmonics.shape[1] - 1)
    return jnp.sum(terms.real, axis=1), jnp.sum((1j * order * terms).real, axis=1) * omega


def inputs_at(excitation: Excitation, mesh: Mesh) -> Inputs:
    """Road and link at the nodes of a mesh; every field is of shape (P,)."""
    dwell, phase = mesh.layout.dwell, jnp.asarray(mesh.phase)
    omega = 2.0 * jnp.pi * excitation.frequency[dwell]
    turned = jnp.angle(excitation.road[:, 1]) if excitation.road.shape[1] > 1 else jnp.zeros(())
    return Inputs(
        Road(*_synthesise(excitation.road[dwell], omega, phase)),
        Link(*_synthesise(excitation.link[dwell], omega, phase)),
        Cam(phase + jnp.broadcast_to(turned, excitation.frequency.shape)[dwell], omega),
    )
