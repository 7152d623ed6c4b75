"""The generalised plant of Fig. 9: the linear equivalent model between its disturbances and its penalties.

          road, drift, noise                accel, deflection, position, command (weighted)
    w  ------------------------>  +-----+  ------------------------------------------------>  z
                                  |  P  |
    u  ------------------------>  +-----+  ------------------------------------------------>  y
          lin_command                       sprung_accel, susp_deflection, lin_position, with noise

Inside are eq. (8), the drive as a first-order lag of 17.8 Hz, and the weights. Two things keep the problem regular.
Every measurement has noise of its own, so that D21 has full rank. The integrator from the actuator's velocity to
z_lin would be neither disturbed nor penalised at zero frequency: ``drift`` disturbs it, and the weight of the
position penalises it.

Every weight is the inverse of an acceptable size, so that a closed loop with gamma = 1 keeps every signal within its
bound under disturbances of their assumed size. The paper's weights (9)-(11) are not printed with all their numbers;
these have the same purpose and were chosen for the rig as it is, friction included. A file changes some of them, the
others keep their defaults:

    weights = read_weights("weights.toml")         # or DEFAULT_WEIGHTS
    weights["accel_bound"].value

    # weights.toml
    accel_bound = { value = 2.0, unit = "m/s^2" }
"""

import tomllib
from pathlib import Path

import control
import numpy as np

from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import Parameter, ParameterTable

DISTURBANCES = ("road", "drift", "noise_accel", "noise_deflection", "noise_position")
"""The external inputs, each of size one."""
PENALTIES = ("accel_weighted", "deflection_weighted", "position_weighted", "command_weighted")
"""The signals that gamma bounds."""
MEASUREMENTS = ("accel_measured", "deflection_measured", "position_measured")
"""Inputs of the controller: [m/s^2], [m], [m]."""
_MEASURED = [0, 1, 3]
"""Their indices among the outputs of eq. (8)."""
COMMAND = "lin_command"
"""Output of the controller: commanded velocity of the equivalent actuator [m/s]."""
COMMAND_ROLL_OFF = 100.0
"""Frequency where the weight of the command stops rising, over its corner frequency [1]."""

DEFAULT_WEIGHTS = ParameterTable(
    (
        Parameter("road_velocity", 0.17, "m/s", lower=1e-6, about="amplitude of the road's velocity"),
        Parameter("noise_accel", 0.1, "m/s^2", lower=1e-9, about="noise of the accelerometer"),
        Parameter("noise_deflection", 4.5e-4, "m", lower=1e-9, about="noise of the potentiometer"),
        Parameter("noise_position", 1e-4, "m", lower=1e-9, about="noise of z_lin from the link's encoder"),
        Parameter("drift", 1e-3, "m/s", lower=1e-9, about="velocity error of the actuator"),
        Parameter("accel_bound", 2.3, "m/s^2", lower=1e-6, about="sprung-mass acceleration"),
        Parameter("accel_corner", 5.0, "Hz", lower=1e-3, about="above this the acceleration matters less"),
        Parameter("deflection_bound", 0.025, "m", lower=1e-6, about="suspension deflection"),
        Parameter("deflection_corner", 4.0, "Hz", lower=1e-3, about="above this the deflection matters less"),
        Parameter("position_bound", 3e-3, "m", lower=1e-6, about="z_lin at standstill: the link returns"),
        Parameter("position_corner", 0.1, "Hz", lower=1e-4, about="above this the position is free"),
        Parameter("command_bound", 0.5, "m/s", lower=1e-6, about="velocity asked of the actuator"),
        Parameter("command_corner", 5.0, "Hz", lower=1e-3, about="above this the command costs more"),
    )
)
"""The default weights."""


def read_weights(path: str | Path) -> ParameterTable:
    """The default weights, changed by those in a TOML file.

    Raises :class:`InputError` for a file that cannot be read, an unknown weight, another unit, or a number out of
    bounds.
    """
    try:
        document = tomllib.loads(Path(path).read_bytes().decode("utf-8"))
    except OSError as error:
        raise InputError(
            f"cannot be read: {error.strerror}", source=path, remedy="name an existing file of weights"
        ) from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"is not valid TOML: {error}", source=path, remedy="mend it there") from error
    values = {name: _number(path, name, entry) for name, entry in document.items()}
    try:
        return DEFAULT_WEIGHTS.with_values(values)
    except InputError as error:
        raise InputError(error.what, source=path, remedy="give a finite, positive number") from None


def _number(path: object, name: str, entry: object) -> float:
    if name not in DEFAULT_WEIGHTS:
        known = ", ".join(DEFAULT_WEIGHTS)
        raise InputError(f"there is no weight '{name}'", source=path, remedy=f"choose among: {known}")
    unit = DEFAULT_WEIGHTS[name].unit
    remedy = f'write {name} = {{ value = ..., unit = "{unit}" }}'
    if not isinstance(entry, dict) or set(entry) != {"value", "unit"}:
        raise InputError(f"{name} is no value with a unit", source=path, remedy=remedy)
    value = entry["value"]
    if entry["unit"] != unit or isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{name} is no number in '{unit}'", source=path, remedy=remedy)
    try:
        return float(value)
    except OverflowError:
        raise InputError(f"{name} is larger than any number", source=path, remedy=remedy) from None


def generalised_plant(
    rig: control.StateSpace, bandwidth: float, weights: ParameterTable
) -> control.StateSpace:
    """The plant from :data:`DISTURBANCES` and :data:`COMMAND` to :data:`PENALTIES` and :data:`MEASUREMENTS`.

    ``rig`` is eq. (8) (:mod:`savgs_ident.control.linear_equivalent`), ``bandwidth`` [Hz] that of the actuator.
    """
    w = weights.as_dict()
    parts = [
        rig,
        actuator(bandwidth),
        _sum("road_velocity", road=w["road_velocity"]),
        _sum("lin_velocity", actuator_velocity=1.0, drift=w["drift"]),
        _sum("accel_measured", sprung_accel=1.0, noise_accel=w["noise_accel"]),
        _sum("deflection_measured", susp_deflection=1.0, noise_deflection=w["noise_deflection"]),
        _sum("position_measured", lin_position=1.0, noise_position=w["noise_position"]),
        _lag(w["accel_corner"], 1.0 / w["accel_bound"], "sprung_accel", "accel_weighted"),
        _lag(w["deflection_corner"], 1.0 / w["deflection_bound"], "susp_deflection", "deflection_weighted"),
        _lag(w["position_corner"], 1.0 / w["position_bound"], "lin_position", "position_weighted"),
        _lead(w["command_corner"], 1.0 / w["command_bound"], COMMAND, "command_weighted"),
    ]
    return control.interconnect(
        parts, inplist=[*DISTURBANCES, COMMAND], outlist=[*PENALTIES, *MEASUREMENTS],
        inputs=[*DISTURBANCES, COMMAND], outputs=[*PENALTIES, *MEASUREMENTS], name="generalised_plant",
        ignore_outputs=["linear_equivalent.tyre_deflection"],
    )  # fmt: skip


def actuator(bandwidth: float) -> control.StateSpace:
    """The drive as the paper's linear actuator: first order, ``bandwidth`` in [Hz]."""
    return _lag(bandwidth, 1.0, COMMAND, "actuator_velocity")


def _lag(corner: float, gain: float, source: str, target: str) -> control.StateSpace:
    """gain / (1 + s/w) with w the ``corner`` [Hz]."""
    w = 2.0 * np.pi * corner
    return control.ss(-w, w, gain, 0.0, inputs=[source], outputs=[target], name=f"{source} to {target}")


def _lead(corner: float, gain: float, source: str, target: str) -> control.StateSpace:
    """gain (1 + s/w) / (1 + s/(100 w)) with w the ``corner`` [Hz]."""
    w, most = 2.0 * np.pi * corner, COMMAND_ROLL_OFF
    through = gain * most
    return control.ss(
        -most * w,
        most * w,
        gain - through,
        through,
        inputs=[source],
        outputs=[target],
        name=f"{source} to {target}",
    )


def _sum(target: str, **gains: float) -> control.StateSpace:
    return control.ss(
        [], [], [], [list(gains.values())], inputs=list(gains), outputs=[target], name=f"sum of {target}"
    )


def driven_loop(rig: control.StateSpace, bandwidth: float) -> control.StateSpace:
    """From the road's velocity [m/s] and the command to the outputs of eq. (8) and then the :data:`MEASUREMENTS`."""
    plant = _driven(rig, bandwidth)
    return control.ss(
        plant.A,
        plant.B,
        np.vstack([plant.C, plant.C[_MEASURED]]),
        np.vstack([plant.D, plant.D[_MEASURED]]),
        inputs=["road_velocity", COMMAND],
        outputs=[*rig.output_labels, *MEASUREMENTS],
    )


def design_loop(rig: control.StateSpace, bandwidth: float) -> control.StateSpace:
    """The plant of the controller: from its command (:data:`COMMAND`) to its :data:`MEASUREMENTS`, without noise.

    ``bandwidth`` [Hz] is that of the drive.
    """
    plant = _driven(rig, bandwidth)
    return control.ss(
        plant.A,
        plant.B[:, 1:],
        plant.C[_MEASURED],
        plant.D[_MEASURED, 1:],
        inputs=[COMMAND],
        outputs=MEASUREMENTS,
    )


def _driven(rig: control.StateSpace, bandwidth: float) -> control.StateSpace:
    """Eq. (8) driven by the actuator: from the road's velocity and the command to its outputs."""
    return rig * control.append(control.ss([], [], [], [[1.0]]), actuator(bandwidth))
