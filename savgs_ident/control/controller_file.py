"""The controller as a file: what a computer needs to run it, with units, as JSON."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import control
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from savgs_ident.control.alpha_map import AlphaMap
from savgs_ident.control.generalised_plant import COMMAND, MEASUREMENTS
from savgs_ident.core.errors import InputError

SCHEMA = 1

MEASUREMENT_UNITS = ("m/s^2", "m", "m")
COMMAND_UNIT = "m/s"


@dataclass(frozen=True)
class DigitalController:
    """A sampled controller with its map from the equivalent actuator to the link.

    Attributes:
        space: discrete, from measurements (acceleration, deflection, z_lin) to the command (velocity of z_lin).
        alpha: how the command becomes a velocity of the link.
    """

    space: control.StateSpace
    alpha: AlphaMap

    @property
    def rate(self) -> float:
        """Samples per second [1/s]."""
        return 1.0 / float(self.space.dt)


def controller_record(controller: DigitalController) -> dict[str, object]:
    """The controller as JSON says it: x[k+1] = A x[k] + B y[k], u[k] = C x[k] + D y[k]."""
    space, alpha = controller.space, controller.alpha
    return {
        "schema": SCHEMA,
        "law": "x[k+1] = A x[k] + B y[k], u[k] = C x[k] + D y[k], thetadot_SL = u / alpha(theta_SL)",
        "rate_hz": controller.rate,
        "measurements": dict(zip(MEASUREMENTS, MEASUREMENT_UNITS, strict=True)),
        "command": {COMMAND: COMMAND_UNIT},
        "A": space.A.tolist(),
        "B": space.B.tolist(),
        "C": space.C.tolist(),
        "D": space.D.tolist(),
        "alpha_m_per_rad": {
            "nominal_angle_rad": float(alpha.nominal),
            "powers_of_angle_from_nominal": np.asarray(alpha.coefficients).tolist(),
        },
    }


def read_controller(path: Path) -> DigitalController:
    """The controller of a file that ``design`` wrote.

    Raises :class:`InputError` if it cannot be read or does not hold one.
    """
    remedy = "give the controller.json that `savgs-ident design` wrote"
    try:
        document = json.loads(path.read_bytes())
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", source=path, remedy=remedy) from error
    except (ValueError, RecursionError) as error:
        raise InputError("is not JSON", source=path, remedy=remedy) from error
    try:
        return _controller(document)
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise InputError(f"holds no controller: {error}", source=path, remedy=remedy) from error


def _controller(document: Mapping[str, object]) -> DigitalController:
    if document["schema"] != SCHEMA or isinstance(document["schema"], bool):
        raise ValueError(f"its schema is {document['schema']!r}, not {SCHEMA}")
    a, b, c, d = (_numbers(document[name]) for name in "ABCD")
    rate, alpha = document["rate_hz"], document["alpha_m_per_rad"]
    if isinstance(rate, bool) or not isinstance(rate, int | float) or not 0.0 < rate < np.inf:
        raise ValueError("rate_hz is no positive number")
    if 1.0 / rate == np.inf:
        raise ValueError("rate_hz is too small")
    if not isinstance(alpha, dict):
        raise TypeError("alpha_m_per_rad is no table")
    powers = _numbers(alpha["powers_of_angle_from_nominal"])
    nominal = _numbers(alpha["nominal_angle_rad"])
    order = len(a)
    shapes = (a.shape, b.shape, c.shape, d.shape, nominal.shape)
    if shapes != ((order, order), (order, 3), (1, order), (1, 3), ()) or powers.ndim != 1 or not powers.size:
        raise ValueError("its matrices do not fit together")
    if not all(np.isfinite(each).all() for each in (a, b, c, d, powers, nominal)):
        raise ValueError("a number is not finite")
    space = control.ss(a, b, c, d, 1.0 / rate, inputs=MEASUREMENTS, outputs=[COMMAND], name="controller")
    return DigitalController(space, AlphaMap(jnp.asarray(nominal), jnp.asarray(powers)))


def _numbers(value: object) -> NDArray[np.float64]:
    found = np.array(value)
    if found.dtype.kind not in "if":
        raise TypeError("what should be numbers is something else")
    return found.astype(np.float64)
