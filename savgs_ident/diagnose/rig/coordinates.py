"""Parameters of rig and effects on coordinates with the unit normal for prior.

What the sheet knows to a tolerance is normal about it. What else is to be identified is log-normal about its start,
wide. The amplitude of an effect begins at its null, two typical sizes wide; what shapes an effect is log-normal
about its typical value, to a factor of two.
"""

from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import Parameter
from savgs_ident.diagnose.engine.coordinates import AbstractCoordinate, Linear, Logarithmic
from savgs_ident.diagnose.engine.prediction import Term
from savgs_ident.model.effect import AbstractEffect

FREE = 1.0
"""Width of the logarithm of a parameter that is to be identified."""

TYPICAL = 2.0
"""Width of an amplitude's prior in typical sizes."""

SHAPE = 0.7
"""Width of the logarithm of what shapes an effect."""


def baseline_coordinate(parameter: Parameter) -> AbstractCoordinate:
    """The coordinate of a parameter that is known to a tolerance, or else is to be identified.

    Raises :class:`InputError` for one without a tolerance whose start is not positive.
    """
    if parameter.tolerance > 0.0:
        each = parameter
        return Linear(each.name, each.unit, each.value, each.tolerance, each.lower, each.upper)
    if not parameter.value > 0.0:
        raise InputError(
            f"{parameter.name} is to be identified from {parameter.value:g} {parameter.unit}",
            remedy="give it a positive value in the rig file: its size, roughly",
        )
    return _logarithmic(parameter, FREE)


def term_of(effect: AbstractEffect) -> Term:
    """An effect as a candidate; what it shares with the rig's sheet (a tolerance) is not its own."""
    own = [each for each in effect.parameters if each.tolerance == 0.0]
    amplitudes = tuple(_amplitude(each, effect.null[each.name]) for each in own if each.name in effect.null)
    shapes = tuple(_logarithmic(each, SHAPE) for each in own if each.name not in effect.null)
    return Term(effect.name, effect.port.value, amplitudes, shapes, tuple(effect.tried))


def _amplitude(each: Parameter, null: float) -> AbstractCoordinate:
    return Linear(each.name, each.unit, null, TYPICAL * abs(each.value - null), each.lower, each.upper)


def _logarithmic(each: Parameter, width: float) -> AbstractCoordinate:
    return Logarithmic(each.name, each.unit, each.value, width, each.lower, each.upper)
