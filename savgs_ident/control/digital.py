"""The controller as a computer runs it: sampled, held, and of lower order where that is asked for."""

import control
import numpy as np

from savgs_ident.core.errors import InputError

RATE = 1000.0
"""Rate of the controller by default [1/s]."""


def discretise(controller: control.StateSpace, rate: float = RATE) -> control.StateSpace:
    """The controller by the bilinear rule at ``rate`` [1/s]; it keeps stability and maps zero frequency exactly."""
    sampled = control.sample_system(controller, 1.0 / rate, method="bilinear")
    return control.ss(
        sampled.A,
        sampled.B,
        sampled.C,
        sampled.D,
        1.0 / rate,
        inputs=controller.input_labels,
        outputs=controller.output_labels,
        name=controller.name,
    )


def sampled_plant(plant: control.StateSpace, rate: float) -> control.StateSpace:
    """What a computer of ``rate`` [1/s] meets: its command is held, and takes effect a sample after its readings."""
    held = control.sample_system(plant, 1.0 / rate, method="zoh")
    late = control.ss(0.0, 1.0, 1.0, 0.0, 1.0 / rate)
    found = held * late
    found.update_names(inputs=held.input_labels, outputs=held.output_labels)
    return found


def reduce_order(controller: control.StateSpace, order: int) -> control.StateSpace:
    """The controller with ``order`` states, by balanced truncation with its static gain kept.

    Raises :class:`InputError` if ``order`` is not between 1 and its present one, or the controller is unstable.
    """
    if not 1 <= order <= controller.nstates:
        raise InputError(
            f"a controller of order {controller.nstates} cannot be reduced to {order}",
            remedy=f"choose an order between 1 and {controller.nstates}",
        )
    if np.any(controller.poles().real >= 0.0):
        raise InputError("the controller itself is unstable and cannot be reduced", remedy="keep its order")
    reduced = control.balred(controller, order, method="matchdc")
    return control.ss(
        reduced.A,
        reduced.B,
        reduced.C,
        reduced.D,
        inputs=controller.input_labels,
        outputs=controller.output_labels,
        name=controller.name,
    )
