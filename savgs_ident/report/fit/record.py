"""A fit as the JSON object of ``fit.json``, and a comparison of model and measurement as that of ``bode.json``.

SI throughout, the unit in the key or beside the value.
"""

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.output import warning_record
from savgs_ident.fit.comparison import Comparison
from savgs_ident.fit.residuals import (
    Gap,
    MeasuredPoints,
    chi2_by_dwell,
    entries_by_dwell,
    gaps,
    measured_points,
    predicted_peak_to_peak,
    whitened,
)
from savgs_ident.fit.result import Fit
from savgs_ident.report.text import per_input_key


def fit_record(fit: Fit) -> dict[str, object]:
    """The contract's keys first, then how the fit went and what is identifiable.

    ``gap`` holds relative rms residuals [1] before and after the fit and of the noise alone ("floor"), and
    the same in noise standard deviations, by channel and "together".
    """
    return {
        "schema": 1,
        "parameters": {
            each.name: {
                "value": each.value,
                "stderr": each.stderr,
                "unit": each.unit,
                "free": each.free,
                "prior": each.prior,
                "prior_sd": each.prior_sd,
            }
            for each in fit.estimates
        },
        "correlation": _named_matrix(fit, fit.correlation),
        "chi2": fit.chi2,
        "dof": fit.dof,
        "chi2_per_dof": fit.chi2 / fit.dof if fit.dof > 0 else None,
        "converged": fit.status.ok and all(status.ok for status in fit.dwell_status),
        "trusted": fit.trusted,
        "gap": gap_record(fit),
        "dwells": _dwells(fit),
        "status": fit.status.name.lower(),
        "advice": fit.status.advice,
        "verdict": {
            "explained": fit.verdict.explained,
            "identifiable": fit.verdict.identifiable,
            "sentences": fit.verdict.sentences,
            "confounded": fit.verdict.confounded,
        },
        "prior_chi2": fit.prior_chi2,
        "effects": fit.effects,
        "quantity": fit.quantity,
        "orders": fit.orders,
        "starts": [{"chi2": chi2, "status": status.name.lower()} for chi2, status in fit.starts],
        "wall_s": fit.wall_s,
        "warnings": [warning_record(warning) for warning in fit.origin.warnings],
    }


def gap_record(fit: Fit) -> dict[str, dict[str, float]]:
    """The gap before and after the fit, by channel and together."""
    before, after = (
        gaps(fit.measured, fit.channels, predicted, fit.used) for predicted in (fit.as_given, fit.predicted)
    )
    return {name: gap_entry(before[name], after[name]) for name in after}


def gap_entry(before: Gap, after: Gap) -> dict[str, float]:
    """One gap before and after as JSON has it, relative [1] and in noise standard deviations."""
    return {
        "before": before.relative,
        "after": after.relative,
        "floor": after.floor,
        "before_sigma": before.sigma,
        "after_sigma": after.sigma,
    }


def _named_matrix(fit: Fit, matrix: NDArray[np.float64]) -> dict[str, dict[str, float]]:
    names = [each.name for each in fit.estimates]
    return {
        name: dict(zip(names, row, strict=True)) for name, row in zip(names, matrix.tolist(), strict=True)
    }


def _dwells(fit: Fit) -> list[dict[str, object]]:
    chi2, entries = chi2_by_dwell(fit), entries_by_dwell(fit)
    sigma = whitened(fit.measured, fit.channels, fit.predicted, fit.used)
    reach = predicted_peak_to_peak(fit.measured, fit.channels, fit.predicted)
    frictionless = predicted_peak_to_peak(fit.measured, fit.channels, fit.frictionless)
    return [
        {
            "test": test,
            "frequency_hz": fit.measured.frequency[d],
            "status": fit.dwell_status[d].name.lower(),
            "chi2": chi2[d],
            "entries": entries[d],
            "channels": {
                name: _dwell_channel(fit, d, c, sigma[d, c])
                | {"peak_to_peak_identified": reach[d, c], "peak_to_peak_simqc": frictionless[d, c]}
                for c, name in enumerate(fit.channels)
                if np.any(fit.used[d, c])
            },
        }
        for d, test in enumerate(fit.measured.tests)
    ]


def _dwell_channel(fit: Fit, d: int, c: int, sigma: NDArray[np.float64]) -> dict[str, object]:
    """Peak to peak as measured, and the whitened residuals of the orders used."""
    channel = fit.measured.channel(fit.channels[c])
    orders = np.flatnonzero(fit.used[d, c])
    return {
        "peak_to_peak": fit.measured.peak_to_peak[d, channel],
        "peak_to_peak_sd": fit.measured.peak_to_peak_sd[d, channel],
        "residual_rms_sigma": np.sqrt(np.mean(sigma[orders] ** 2)),
        "residual_sigma": {"order": orders, "re": sigma[orders, 0], "im": sigma[orders, 1]},
    }


def bode_record(compared: Comparison) -> dict[str, object]:
    """The JSON object of ``bode``; first harmonics per unit of the input, phase against it, SI."""
    given = compared.given
    names, key = [each.name for each in given.channels], per_input_key(given)
    points = measured_points(compared.measured, names, given.plant.inputs[0].name)
    model, frictionless = compared.model.curve(""), compared.frictionless.curve("")
    gap = gaps(compared.measured, names, compared.model.harmonics, compared.used)
    return {
        "schema": 1,
        "effects": list(compared.effects),
        "tests": compared.measured.tests,
        "frequency_hz": points.frequency,
        "status": [status.name.lower() for status in compared.model.status],
        "converged": compared.trusted,
        "gap": {name: _gap(entry) for name, entry in gap.items()},
        "channels": {
            each.name: {
                "unit": each.unit,
                "measured": _measured(points, c, key),
                "identified": _transfer(model.transfer[:, c], model.peak_to_peak[:, c], key),
                "simqc": _transfer(frictionless.transfer[:, c], frictionless.peak_to_peak[:, c], key),
            }
            for c, each in enumerate(given.channels)
        },
    }


def _gap(gap: Gap) -> dict[str, float]:
    return {"relative": gap.relative, "floor": gap.floor, "sigma": gap.sigma}


def _measured(points: MeasuredPoints, c: int, key: str) -> dict[str, object]:
    return _transfer(points.transfer[:, c], points.peak_to_peak[:, c], key) | {
        f"{key}_sd": points.magnitude_sd[:, c],
        "phase_sd_deg": np.degrees(points.phase_sd[:, c]),
        "peak_to_peak_sd": points.peak_to_peak_sd[:, c],
    }


def _transfer(transfer: NDArray[np.complex128], reach: NDArray[np.float64], key: str) -> dict[str, object]:
    return {
        key: np.abs(transfer),
        "phase_deg": np.degrees(np.angle(transfer)),
        "peak_to_peak": reach,
    }
