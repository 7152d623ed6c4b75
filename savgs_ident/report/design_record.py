"""An H-infinity design as the JSON object of ``design.json``."""

from math import isfinite
from typing import Any

import numpy as np

from savgs_ident.control.design import Design
from savgs_ident.control.margins import Margins
from savgs_ident.control.quarter_car_space import TwoMasses
from savgs_ident.control.robustness import Robustness
from savgs_ident.report.design_words import complaints, least_gain, peak_in_use
from savgs_ident.report.model_origin import ModelOrigin


def design_record(design: Design, origin: ModelOrigin) -> dict[str, Any]:
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
        "complaints": list(complaints(design)),
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
            "continuous": _margins(design.margins),
            "sampled": _margins(design.digital_margins),
        },
        "robustness": _robustness(design.robustness, design.rigs.source),
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


def _margins(margins: Margins) -> dict[str, Any]:
    found = {
        "gain_up": margins.gain_up,
        "gain_down": least_gain(margins),
        "phase_deg": margins.phase_deg,
        "delay_s": margins.delay,
        "sensitivity_peak": margins.sensitivity,
    }
    return {"stable": margins.stable} | (found if margins.stable else dict.fromkeys(found))


def _robustness(robustness: Robustness, source: str) -> dict[str, Any]:
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
