"""An H-infinity design in words, as tables in the terminal, and as the JSON object of ``design.json``."""

from collections.abc import Mapping
from math import inf, isfinite, log10
from types import MappingProxyType
from typing import Any

import numpy as np
from rich.console import Group, RenderableType

from savgs_ident.control.design import Design
from savgs_ident.control.linear_equivalent import TwoMasses
from savgs_ident.control.synthesis import Margins, Robustness, largest_gain
from savgs_ident.core.presentation import Origin
from savgs_ident.report.text import DASH, decimal, fixed, plain, significant, table

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
    result = what if is_reduced(design) else f"keeps gamma = {gamma}"
    return f"The controller {result} and is stable on every one of {count} rigs."


def failed_checks(design: Design) -> tuple[str, ...]:
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
    """The same as a sentence; empty if all checks passed."""
    found = "; ".join(failed_checks(design))
    return f"{found[0].upper()}{found[1:]}." if found else ""


def reduced_words(design: Design) -> str:
    """What the reduction of the controller's order costs; empty if it was not reduced."""
    if not is_reduced(design):
        return ""
    peak, full = peak_in_use(design), design.synthesis.controller.nstates
    if not design.margins.stable:
        return f"The controller of order {full} was reduced to {design.controller.nstates}: its loop is not stable."
    side = "within" if peak <= design.synthesis.gamma else "beyond"
    return (
        f"The controller of order {full} was reduced to {design.controller.nstates}: its closed loop reaches"
        f" {decimal(peak, 3)}, which is {side} gamma."
    )


def design_text(record: Mapping[str, Any]) -> RenderableType:
    """Tables of what :func:`design_record` says, most important first."""
    parts = [_promise(record), _margins(record["margins"]), _robustness(record), _regularisation(record)]
    return Group(*parts, _weights(record["weights"]))


def _promise(record: Mapping[str, Any]) -> RenderableType:
    confirmed = "confirmed" if record["gamma_confirmed"] else "NOT confirmed"
    order, full = record["order"], record["order_full"]
    reduced = f", reduced from {full}, peak {fixed(record['peak_in_use'], 4)}" if order < full else ""
    lines = (
        f"Controller for {record['rig']}",
        f"gamma {record['gamma']:.4f}, the least is {record['gamma_least']:.4f}; {confirmed} by a sweep:"
        f" peak {record['peak']:.4f} at {record['peak_frequency_hz']:.3g} Hz",
        f"order {order}{reduced}, sampled at {record['rate_hz']:g} Hz",
    )
    head, *rest = lines
    return Group(plain(head, "bold"), *(plain(line) for line in rest), plain(""))


def _margins(margins: Mapping[str, Any]) -> RenderableType:
    rows = [
        (
            name,
            "yes" if each["stable"] else "NO",
            significant(_finite(each["gain_up"]), 3),
            significant(_finite(each["gain_down"]), 3),
            fixed(each["phase_deg"], 1),
            _milliseconds(each["delay_s"]),
            fixed(each["sensitivity_peak"], 2),
        )
        for name, each in margins.items()
    ]
    headers = ("loop", "stable", "gain up", "gain down", "phase [deg]", "delay [ms]", "peak of sensitivity")
    return table("Margins at the command", headers, rows, (0, 1))


def _robustness(record: Mapping[str, Any]) -> RenderableType:
    found = record["robustness"]
    stable = "all stable" if found["all_stable"] else "NOT all stable"
    return Group(
        plain("On other rigs", "bold"),
        plain(
            f"{found['source']}: {stable}; worst peak {fixed(_finite(found['worst_peak']), 3)},"
            f" least phase margin {fixed(found['least_phase_margin_deg'], 1)} deg"
        ),
        plain(""),
    )


def _regularisation(record: Mapping[str, Any]) -> RenderableType:
    rows = [
        (
            WEIGHT_WORDS[each["weight"]],
            f"{each['factor']:g}",
            fixed(_finite(each["gamma_least"]), 4),
            fixed(_finite(each["phase_margin_deg"]), 1),
            fixed(_finite(each["fastest_pole_rad_per_s"]), 0),
        )
        for each in record["regularisation"]
    ]
    headers = ("weight", "times", "least gamma", "phase [deg]", "fastest pole [rad/s]")
    return table("What the regularising weights do", headers, rows)


def _weights(weights: Mapping[str, Any]) -> RenderableType:
    rows = [(name, significant(each["value"]), each["unit"], each["about"]) for name, each in weights.items()]
    return table("Weights", ("weight", "value", "unit", "description"), rows, (0, 2, 3))


def _finite(value: float | None) -> float | None:
    """A number, None where it is not finite."""
    return value if value is not None and isfinite(value) else None


def _milliseconds(seconds: float | None) -> str:
    finite = _finite(seconds)
    return fixed(None if finite is None else 1e3 * finite, 1)


def design_record(design: Design, origin: Origin) -> dict[str, Any]:
    """Gamma and its check, margins, robustness, what the regularising weights do, and from what it was made.

    ``peak`` and ``peak_frequency_hz`` are of the closed loop with the full controller, which gamma is about;
    ``peak_in_use`` is with the one that is used. A margin that does not exist is null, as is everything about a loop
    that is not stable.
    """
    synthesis = design.synthesis
    return {
        "schema": 1,
        "rig": origin.rig,
        "effects": list(origin.effects),
        "trusted": design.trusted,
        "complaints": list(failed_checks(design)),
        "gamma": synthesis.gamma,
        "gamma_least": synthesis.gamma_least,
        "gamma_confirmed": synthesis.holds,
        "peak": synthesis.peak,
        "peak_frequency_hz": synthesis.peak_frequency,
        "peak_in_use": peak_in_use(design),
        "order": design.controller.nstates,
        "order_full": synthesis.controller.nstates,
        "rate_hz": design.digital.rate,
        "actuator_bandwidth_hz": design.bandwidth,
        "margins": {
            "continuous": _margins_entry(design.margins),
            "sampled": _margins_entry(design.digital_margins),
        },
        "robustness": _robustness_entry(design.robustness, design.rigs.source),
        "regularisation": [
            {
                "weight": each.weight,
                "factor": each.factor,
                "gamma_least": each.gamma_least,
                "phase_margin_deg": each.phase_deg,
                "fastest_pole_rad_per_s": each.fastest_pole,
            }
            for each in design.regularisation
        ],
        "weights": {
            each.name: {"value": each.value, "unit": each.unit, "about": each.about}
            for each in design.weights.entries
        },
        "equation_8": _masses(design.masses),
        "model": origin.model,
        "command": origin.command_line,
        "versions": dict(origin.versions),
    }


def _margins_entry(margins: Margins) -> dict[str, Any]:
    found = {
        "gain_up": margins.gain_up,
        "gain_down": least_gain(margins),
        "phase_deg": margins.phase_deg,
        "delay_s": margins.delay,
        "sensitivity_peak": margins.sensitivity,
    }
    return {"stable": margins.stable} | (found if margins.stable else dict.fromkeys(found))


def _robustness_entry(robustness: Robustness, source: str) -> dict[str, Any]:
    peaks = np.array(robustness.peaks)
    return {
        "count": peaks.size,
        "source": source,
        "all_stable": robustness.stable,
        "worst_peak": float(peaks.max()),
        "least_phase_margin_deg": min(each.phase_deg for each in robustness.margins if each.stable)
        if any(each.stable for each in robustness.margins)
        else None,
        "peaks": [float(peak) if isfinite(peak) else None for peak in peaks],
        "phase_margins_deg": [each.phase_deg if each.stable else None for each in robustness.margins],
    }


def _masses(masses: TwoMasses) -> dict[str, Any]:
    return {
        "m_s": {"value": float(masses.mass[0, 0]), "unit": "kg"},
        "m_u": {"value": float(masses.mass[1, 1]), "unit": "kg"},
        "k_eq": {"value": masses.k_eq, "unit": "N/m"},
        "c_eq": {"value": masses.c_eq, "unit": "N s/m"},
        "k_t": {"value": masses.k_t, "unit": "N/m"},
        "c_t": {"value": masses.c_t, "unit": "N s/m"},
    }
