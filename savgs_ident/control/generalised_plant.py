"""The generalised plant of Fig. 9: the linear equivalent model between its disturbances and what may not grow large.

          road, drift, noise                accel, deflection, position, command (weighted)
    w  ------------------------>  +-----+  ------------------------------------------------>  z
                                  |  P  |
    u  ------------------------>  +-----+  ------------------------------------------------>  y
          lin_command                       sprung_accel, susp_deflection, lin_position, with noise

Inside: eq. (8), the drive as the first-order lag of its 17.8 Hz, the weights. Two things keep the problem regular.
Every measurement has noise of its own, so that D21 has full rank. The integrator between the actuator's velocity and
z_lin would be neither disturbed nor seen in z at zero frequency: ``drift`` disturbs it, the weight of the position
sees it.
"""

import control
import numpy as np

from savgs_ident.core.parameter import ParameterTable

DISTURBANCES = ("road", "drift", "noise_accel", "noise_deflection", "noise_position")
"""What comes from outside, each of size one."""

PENALTIES = ("accel_weighted", "deflection_weighted", "position_weighted", "command_weighted")
"""What may not grow beyond gamma."""

MEASUREMENTS = ("accel_measured", "deflection_measured", "position_measured")
"""Inputs of the controller: [m/s^2], [m], [m]."""

_MEASURED = [0, 1, 3]
"""Which outputs of eq. (8) they are."""

COMMAND = "lin_command"
"""Output of the controller: velocity asked of the equivalent actuator [m/s]."""

COMMAND_ROLL_OFF = 100.0
"""Where the weight of the command ceases to grow, over the corner where it begins [1]."""


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


def actuator(bandwidth: float) -> control.StateSpace:
    """The drive as the paper's linear actuator: first order, ``bandwidth`` in [Hz]."""
    return _lag(bandwidth, 1.0, COMMAND, "actuator_velocity")


def generalised_plant(
    rig: control.StateSpace, bandwidth: float, weights: ParameterTable
) -> control.StateSpace:
    """The plant from :data:`DISTURBANCES` and :data:`COMMAND` to :data:`PENALTIES` and :data:`MEASUREMENTS`.

    ``rig`` is eq. (8) (:mod:`savgs_ident.control.quarter_car_space`), ``bandwidth`` [Hz] that of the actuator.
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


def _moved(rig: control.StateSpace, bandwidth: float) -> control.StateSpace:
    """Eq. (8) moved by the actuator: from the road's velocity and the command to its outputs."""
    return rig * control.append(control.ss([], [], [], [[1.0]]), actuator(bandwidth))


def driven_loop(rig: control.StateSpace, bandwidth: float) -> control.StateSpace:
    """From the road's velocity [m/s] and the command to the outputs of eq. (8) and then the :data:`MEASUREMENTS`."""
    plant = _moved(rig, bandwidth)
    return control.ss(
        plant.A,
        plant.B,
        np.vstack([plant.C, plant.C[_MEASURED]]),
        np.vstack([plant.D, plant.D[_MEASURED]]),
        inputs=["road_velocity", COMMAND],
        outputs=[*rig.output_labels, *MEASUREMENTS],
    )


def design_loop(rig: control.StateSpace, bandwidth: float) -> control.StateSpace:
    """What the controller works on: from its command (:data:`COMMAND`) to its :data:`MEASUREMENTS`, without noise.

    ``bandwidth`` [Hz] is that of the drive.
    """
    plant = _moved(rig, bandwidth)
    return control.ss(
        plant.A,
        plant.B[:, 1:],
        plant.C[_MEASURED],
        plant.D[_MEASURED, 1:],
        inputs=[COMMAND],
        outputs=MEASUREMENTS,
    )
