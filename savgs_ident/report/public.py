"""What ``import savgs_ident`` offers of pictures: the frequency response of whatever has one."""

from typing import TYPE_CHECKING

from savgs_ident.core.errors import InputError
from savgs_ident.core.presentation import Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_FIGURES = {
    "FIT": "bode",
    "COMPARISON": "bode",
    "SIMULATED_RESPONSE": "simulate",
    "POSTERIOR": "predicted",
    "DIAGNOSIS": "bode",
}
"""By presenter, the first word of the name of the figure that shows the response."""


def plot_bode(result: Result) -> "Figure":
    """Magnitude, phase and peak to peak over frequency: the model against the measurement where there is one.

    Of a fit, a comparison, a simulated response, a posterior or a diagnosis. The other figures of a result are
    ``result.figure(name)``, with a name of ``result.figure_names``.

    Raises :class:`InputError` for a result that has no frequency response.
    """
    names = [each for each in result.figure_names if each.split(" ")[0] == _FIGURES.get(result.presenter)]
    if not names:
        raise InputError(
            f"a {type(result).__name__} has no frequency response",
            remedy="choose among its figures: " + ", ".join(result.figure_names),
        )
    return result.figure(names[0])
