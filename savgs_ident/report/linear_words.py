"""What a study of linear models says in words."""

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from savgs_ident.control.linear_study import EquivalentStudy, LinearStudy, SmallMotions
from savgs_ident.report.numerals import decimal, numeral, percentage, signed

ELEMENT_WORDS: Mapping[str, str] = MappingProxyType(
    {"rail": "friction of the rail", "strut": "damper", "tyre_lateral": "lateral friction of the tyre"}
)
"""The elements that are described."""

FAR = 0.05
"""From here on the rig with describing functions is called far from the nonlinear one, relatively [1]."""

_UNKNOWN = float("nan")


def digits(value: float) -> str:
    """A number of any unit to four digits."""
    return numeral(value, _UNKNOWN)


def step_words(small: SmallMotions) -> dict[str, str]:
    """What every linear model takes into account, by its name."""
    printed, at_rest, spread = small.masses.values()
    steeper = signed(100.0 * (at_rest.c_eq / printed.c_eq - 1.0), 0)
    lump, turning = (decimal(float(each.mass[1, 1]), 1) for each in (printed, spread))
    sentences = (
        "Two point masses, and the damper's coefficient that takes the same energy at 0.15 m/s: as printed.",
        f"A motion that small meets the damper's slope at rest: {steeper} % on the coefficient.",
        f"Wishbones and upright turn: the {lump} kg of the unsprung mass act as {turning} kg at the wheel.",
        "The static load turns with the wishbones, too, and the tyre's contact point moves with the camber.",
    )
    return dict(zip(small.models, sentences, strict=True))


def sign_of_alpha(study: EquivalentStudy) -> str:
    """Whether alpha is negative or positive over the link angle, in a word."""
    return "negative" if np.nanmean(study.resting.alpha) < 0.0 else "positive"


def slow_words(small: SmallMotions) -> str:
    """What a slow turn of the link does, and why it is not what equation (8) says."""
    return (
        f"A link that turns slowly moves the suspension by {decimal(small.slow_link, 3)} of z_lin, by the exact"
        " linearisation; by all of it in equation (8). The share of k_eq that comes from the static load does not"
        " follow the link."
    )


def headline(study: LinearStudy) -> str:
    """What the suspension is, in one sentence."""
    nominal = study.equivalents.nominal
    stiffness, damping = decimal(float(nominal.k_eq) / 1e3, 2), decimal(float(nominal.c_eq) / 1e3, 3)
    return (
        f"Seen at the wheel, the suspension is a spring of {stiffness}\u00a0kN/m and a damper of"
        f" {damping}\u00a0kN\u00a0s/m."
    )


def alarm(study: LinearStudy) -> str:
    """Why the linear models are not to be trusted; empty if they are."""
    if study.trusted:
        return ""
    error = percentage(study.small.error(list(study.small.models)[-1]))
    return (
        f"The exact linearisation is {error} off the nonlinear rig at small motions:"
        " the rig is not smooth at rest."
    )


def described_words(study: LinearStudy) -> str:
    """How well the describing functions hold, in a sentence; that there is nothing to describe without friction."""
    if study.at_test is None:
        return "Without friction there is nothing to describe."
    error = percentage(study.at_test.error)
    if study.at_test.error < FAR:
        return f"With them the linear rig is within {error} of the nonlinear one on the cam of the test."
    return (
        f"With them the linear rig is still up to {error} off the nonlinear one: this rig has effects outside of its"
        " rail, its damper and its tyre's friction."
    )
