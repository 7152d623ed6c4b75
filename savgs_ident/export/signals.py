"""What stands in the vectors of exported equations: names, units, nominal values, as JSON."""

from collections.abc import Iterable, Sequence
from math import degrees, isfinite

import jax.numpy as jnp

from savgs_ident.core.errors import InputError
from savgs_ident.export.equations import Signal
from savgs_ident.export.exported_model import ExportedModel
from savgs_ident.model.equilibrium import static_equilibrium
from savgs_ident.model.values import as_values


def resting_state(model: ExportedModel) -> list[float]:
    """x [SI] at rest at the nominal link angle, the plate at its zero: where a simulation begins.

    Raises :class:`InputError` if the rig finds no rest there.
    """
    p = as_values(model.table.as_dict())
    rest = static_equilibrium(model.equations.model, p, p["psi_nominal"], jnp.zeros(()))
    x = [float(rest.q.z_s), float(rest.q.theta_LW), 0.0, 0.0, *(float(state) for state in rest.s)]
    check_rest(x, model)
    return x


def check_rest(found: Iterable[float], model: ExportedModel) -> None:
    """Raise :class:`InputError` if what was ``found`` [SI] at the nominal link angle is no rest."""
    if not all(isfinite(value) for value in found):
        angle = degrees(model.table["psi_nominal"].value)
        raise InputError(
            f"the rig finds no rest with its link at the nominal {angle:.4g} deg",
            remedy="mend its spring (k_sd, l_free), masses or hardpoints",
        )


def resting_inputs(model: ExportedModel) -> list[float]:
    """u [SI] at rest: everything zero but the link's nominal angle."""
    nominal = model.table["psi_nominal"].value
    return [nominal if signal.name == "link_angle" else 0.0 for signal in model.equations.inputs]


def signals_record(model: ExportedModel) -> dict[str, object]:
    """Names and units of x, u, the outputs and p in their order, with values at rest and of the parameters.

    Raises :class:`InputError` if the rig finds no rest.
    """
    equations, table = model.equations, model.table
    return {
        "x": _told(equations.states, resting_state(model)),
        "u": _told(equations.inputs, resting_inputs(model)),
        "outputs": [_one(signal) for signal in equations.outputs],
        "p": [
            {"name": name, "unit": table[name].unit, "about": table[name].about, "value": table[name].value}
            for name in equations.parameters
        ],
    }


def _one(signal: Signal) -> dict[str, object]:
    return {"name": signal.name, "unit": signal.unit, "about": signal.about}


def _told(signals: Sequence[Signal], values: Sequence[float]) -> list[dict[str, object]]:
    return [_one(signal) | {"at_rest": value} for signal, value in zip(signals, values, strict=True)]
