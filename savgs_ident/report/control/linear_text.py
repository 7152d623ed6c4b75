"""The linear models of a rig in words, as tables in the terminal, and as the JSON object of ``linearise.json``."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import control
import numpy as np
from numpy.typing import NDArray
from rich.console import Group, RenderableType

from savgs_ident.control.linear_equivalent import INPUTS, OUTPUTS, STATES, quarter_car_space
from savgs_ident.control.linear_study import (
    CHANNELS,
    SMALL,
    Approximation,
    CamMotions,
    EquivalentStudy,
    LinearStudy,
    SmallMotions,
)
from savgs_ident.control.linearisation import ELEMENTS
from savgs_ident.core.presentation import Origin
from savgs_ident.plants.quarter_car.rig_recordings import RIG_LAYOUT
from savgs_ident.report.text import decimal, fixed, numeral, percentage, plain, signed, significant, table

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


_SHOWN = (1.0, 2.0, 2.35, 3.0, 6.0)
"""Frequencies whose describing functions are shown [Hz]; all are in the file."""


def linear_text(record: Mapping[str, Any]) -> RenderableType:
    """Tables of what :func:`linear_record` says, most important first."""
    return Group(
        _nominal(record),
        _approximations(record),
        _small(record["small_motions"]),
        *_test(record["test_motions"]),
    )


def _nominal(record: Mapping[str, Any]) -> RenderableType:
    rows = [
        (name, significant(each["value"], 5), "" if each["unit"] == "1" else each["unit"])
        for name, each in record["nominal"].items()
    ]
    return table(
        f"Linear equivalent of {record['rig']} in the nominal state", ("", "value", "unit"), rows, (0, 2)
    )


def _approximations(record: Mapping[str, Any]) -> RenderableType:
    rows = [
        (name, fixed(each["rms_percent"], 2), fixed(each["largest_percent"], 2))
        for name, each in record["approximations"].items()
    ]
    headers = ("over the link angle", "rms left [%]", "largest [%]")
    return table("What stands for them", headers, rows)


def _small(small: Mapping[str, Any]) -> RenderableType:
    rows = [
        (name, fixed(each["largest_error_percent"], 2), each["explanation"])
        for name, each in small["models"].items()
    ]
    headers = ("linear model", "off by [%]", "what it takes into account")
    title = "Small motions: largest difference to the nonlinear rig without friction"
    return Group(table(title, headers, rows, (0, 2)), plain(small["slow_link"]["explanation"]), plain(""))


def _test(test: Mapping[str, Any] | None) -> list[RenderableType]:
    if test is None:
        return []
    gains = test["describing_functions"]
    headers = ("[Hz]", *(ELEMENT_WORDS[element] for element in gains))
    rows = [
        (f"{frequency:g}", *(fixed(float(gain["damping_n_s_per_m"][d]), 0) for gain in gains.values()))
        for d, frequency in enumerate(test["frequency_hz"])
        if frequency in _SHOWN
    ]
    return [
        table("Equivalent dampings [N s/m] on the cam of the test", headers, rows, ()),
        plain(test["explanation"]),
        plain(""),
    ]


UNITS = {"k_eq": "N/m", "c_eq": "N s/m", "alpha": "m/rad", "ratio": "1"}
"""Of the parts of the linear equivalent."""

_STATE_UNITS = dict(zip(STATES, ("m/s", "m/s", "m", "m", "m"), strict=True))
_INPUT_UNITS = dict(zip(INPUTS, ("m/s", "m/s"), strict=True))
_OUTPUT_UNITS = dict(zip(OUTPUTS, ("m/s^2", "m", "m", "m"), strict=True))


def linear_record(study: LinearStudy, origin: Origin) -> dict[str, Any]:
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
            "unit": RIG_LAYOUT.si_unit(name),
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
