"""Weights of the H-infinity design: how large each signal may be, and where in frequency that matters.

Every weight is one over what is acceptable, so that a closed loop with gamma = 1 keeps every signal within its
bound under disturbances of their assumed size. The paper's weights (9)-(11) are not printed with all their numbers;
these have the same purpose and were chosen for the rig as it is, friction included.

    weights = read_weights("weights.toml")         # or DEFAULT_WEIGHTS
    weights["accel_bound"].value

A file changes some of them, the rest stay as they are:

    accel_bound = { value = 2.0, unit = "m/s^2" }
"""

import tomllib
from pathlib import Path

from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import Parameter, ParameterTable

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
"""The weights that come with the package."""


def read_weights(path: str | Path) -> ParameterTable:
    """The default weights with those of a TOML file in their place.

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
