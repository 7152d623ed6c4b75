"""What an H-infinity design says in words."""

from collections.abc import Mapping
from math import inf, isfinite, log10
from types import MappingProxyType

from savgs_ident.control.design import Design
from savgs_ident.control.margins import Margins
from savgs_ident.control.synthesis import largest_gain
from savgs_ident.report.numerals import DASH, decimal

WEIGHT_WORDS: Mapping[str, str] = MappingProxyType(
    {
        "noise_accel": "noise of the accelerometer",
        "noise_deflection": "noise of the potentiometer",
        "noise_position": "noise of z_lin",
        "drift": "drift of the actuator",
    }
)
"""The weights that keep the problem regular."""


NO_GAIN = 1e-6
"""A loop with less than this share of its gain is open: what becomes unstable there does so by rounding [1]."""


def least_gain(margins: Margins) -> float | None:
    """The greatest factor below one that makes the loop unstable [1]; None where none does."""
    return margins.gain_down if margins.gain_down > NO_GAIN else None


def gain_margin_words(factor: float | None) -> str:
    """A gain margin as a factor and in decibel; a dash where no factor makes the loop unstable."""
    if factor is None or not isfinite(factor):
        return DASH
    return f"{decimal(factor, 2 if factor >= 0.1 else 4)} ({decimal(20.0 * log10(factor), 1)} dB)"


def peak_in_use(design: Design) -> float:
    """Largest singular value of the closed loop with the controller that is used [1]; infinite if it is unstable."""
    return largest_gain(design.closed)[0] if design.margins.stable else inf


def is_reduced(design: Design) -> bool:
    """Whether the controller has fewer states than that of the synthesis, which gamma is about."""
    return bool(design.controller.nstates < design.synthesis.controller.nstates)


def headline(design: Design) -> str:
    """What the design is worth, in one sentence."""
    gamma, count = decimal(design.synthesis.gamma, 3), len(design.rigs.values)
    if not design.trusted:
        return f"A controller was made for gamma = {gamma}, but it does not pass its checks."
    what = f"of order {design.controller.nstates} reaches {decimal(peak_in_use(design), 3)}"
    kept = what if is_reduced(design) else f"keeps gamma = {gamma}"
    return f"The controller {kept} and is stable on every one of {count} rigs."


def complaints(design: Design) -> tuple[str, ...]:
    """Why the controller is not to be trusted; nothing if it is."""
    unstable = sum(not each.stable for each in design.robustness.margins)
    found = {
        "the sweep over frequency does not confirm gamma": not design.synthesis.holds,
        "the loop is not stable with the controller as it is used": not design.margins.stable,
        f"the loop is not stable when sampled at {design.digital.rate:g} Hz": not design.digital_margins.stable,
        f"the loop is not stable on {unstable} of {len(design.rigs.values)} rigs": unstable > 0,
    }
    return tuple(words for words, true in found.items() if true)


def alarm(design: Design) -> str:
    """The same as a sentence; empty if there is nothing to complain about."""
    found = "; ".join(complaints(design))
    return f"{found[0].upper()}{found[1:]}." if found else ""


def reduced_words(design: Design) -> str:
    """What the reduction of the controller's order costs; empty if it was not reduced."""
    if not is_reduced(design):
        return ""
    peak, full = peak_in_use(design), design.synthesis.controller.nstates
    if not design.margins.stable:
        return f"The controller of order {full} was reduced to {design.controller.nstates}: its loop is not stable."
    kept = "within" if peak <= design.synthesis.gamma else "beyond"
    return (
        f"The controller of order {full} was reduced to {design.controller.nstates}: its closed loop reaches"
        f" {decimal(peak, 3)}, which is {kept} gamma."
    )
