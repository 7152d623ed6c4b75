"""The linear models of a rig as the JSON object of ``linearise.json``."""

from typing import Any

import control
import numpy as np
from numpy.typing import NDArray

from savgs_ident.control.approximation import Approximation
from savgs_ident.control.describing_function import ELEMENTS
from savgs_ident.control.linear_study import (
    CHANNELS,
    SMALL,
    CamMotions,
    EquivalentStudy,
    LinearStudy,
    SmallMotions,
)
from savgs_ident.control.quarter_car_space import INPUTS, OUTPUTS, STATES, quarter_car_space
from savgs_ident.recordings.recording import CANONICAL_UNITS
from savgs_ident.report.linear_words import described_words, slow_words, step_words
from savgs_ident.report.model_origin import ModelOrigin

UNITS = {"k_eq": "N/m", "c_eq": "N s/m", "alpha": "m/rad", "ratio": "1"}
"""Of the parts of the linear equivalent."""

_STATE_UNITS = dict(zip(STATES, ("m/s", "m/s", "m", "m", "m"), strict=True))
_INPUT_UNITS = dict(zip(INPUTS, ("m/s", "m/s"), strict=True))
_OUTPUT_UNITS = dict(zip(OUTPUTS, ("m/s^2", "m", "m", "m"), strict=True))


def linear_record(study: LinearStudy, origin: ModelOrigin) -> dict[str, Any]:
    """The linear equivalent, its approximations, how far every linear model is from the nonlinear rig, and eq. (8).

    Responses are first harmonics per metre of road, SI; errors are the largest over channels and frequencies.
    ``test_motions`` is null for a rig without friction.
    """
    nominal = study.equivalents.nominal
    return {
        "schema": 1,
        "rig": origin.rig,
        "effects": list(origin.effects),
        "trusted": study.trusted,
        "nominal": {
            name: {"value": float(getattr(nominal, name)), "unit": unit} for name, unit in UNITS.items()
        },
        "over_link_angle": _over_link_angle(study.equivalents),
        "approximations": {
            name: _approximation(name, each) for name, each in study.equivalents.approximations.items()
        },
        "small_motions": _small_motions(study.small),
        "test_motions": None
        if study.at_test is None
        else _test_motions(study.at_test, described_words(study)),
        "state_space": _space(quarter_car_space(next(iter(study.small.masses.values())))),
        "model": origin.model,
        "command": origin.command_line,
        "versions": dict(origin.versions),
    }


def _over_link_angle(study: EquivalentStudy) -> dict[str, Any]:
    return {
        "link_angle_deg": study.link_deg,
        "wishbone_angle_deg": study.wishbone_deg,
        "units": UNITS,
    } | {name: getattr(study.resting, name) for name in UNITS}


def _approximation(name: str, each: Approximation) -> dict[str, Any]:
    return {
        "coefficients": each.coefficients,
        "of": "powers of the link angle [rad], constant first",
        "unit": UNITS[name.split(" ")[0]],
        "rms_percent": 100.0 * each.rms,
        "largest_percent": 100.0 * each.largest,
    }


def _small_motions(small: SmallMotions) -> dict[str, Any]:
    words = step_words(small)
    return {
        "cam_peak_to_peak_m": SMALL,
        "frequency_hz": small.frequency,
        "nonlinear": _response(small.nonlinear),
        "models": {
            name: {
                "largest_error_percent": 100.0 * small.error(name),
                "explanation": words[name],
                "channels": _response(response),
            }
            for name, response in small.models.items()
        },
        "slow_link": {"value": small.slow_link, "unit": "1", "explanation": slow_words(small)},
    }


def _test_motions(test: CamMotions, words: str) -> dict[str, Any]:
    described = test.described
    return {
        "frequency_hz": described.frequency,
        "nonlinear": _response(test.nonlinear),
        "quasi_linear": _response(test.quasi_linear),
        "largest_error_percent": 100.0 * test.error,
        "explanation": words,
        "describing_functions": {
            element: {
                "damping_n_s_per_m": described.damping[:, place],
                "stiffness_n_per_m": described.stiffness[:, place],
            }
            for place, element in enumerate(ELEMENTS)
        },
    }


def _response(response: NDArray[np.complex128]) -> dict[str, Any]:
    return {
        name: {
            "unit": CANONICAL_UNITS[name],
            "per_metre_of_road": np.abs(response[:, c]),
            "phase_deg": np.degrees(np.angle(response[:, c])),
        }
        for c, name in enumerate(CHANNELS)
    }


def _space(space: control.StateSpace) -> dict[str, Any]:
    return {
        "equation": "equation (8): dx/dt = A x + B u, y = C x + D u",
        "states": _STATE_UNITS,
        "inputs": _INPUT_UNITS,
        "outputs": _OUTPUT_UNITS,
        "A": space.A,
        "B": space.B,
        "C": space.C,
        "D": space.D,
    }
