"""What a Bode figure shows, as a JSON object: measured and modelled responses at the dwells, their gap."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from savgs_ident.recordings.recording import CANONICAL_UNITS
from savgs_ident.report.curves import MeasuredPoints, measured_points
from savgs_ident.report.readings import READINGS
from savgs_ident.report.residuals import Gap, gaps
from savgs_ident.report.solving import Solved
from savgs_ident.responses.harmonic_response import HarmonicResponse


@dataclass(frozen=True)
class Compared:
    """A model and its frictionless kin held against D measured dwells.

    ``used`` (D, 2, orders + 1) tells which entries are compared: only dwells that the model solved.
    """

    measured: HarmonicResponse
    model: Solved
    frictionless: Solved
    used: NDArray[np.bool_]


def bode_record(compared: Compared, effects: Sequence[str]) -> dict[str, object]:
    """The JSON object of ``bode``; first harmonics per metre of road, phase against the road, SI."""
    points = measured_points(compared.measured)
    model, frictionless = compared.model.curve(""), compared.frictionless.curve("")
    gap = gaps(compared.measured, compared.model.harmonics, compared.used)
    return {
        "schema": 1,
        "effects": list(effects),
        "tests": compared.measured.tests,
        "frequency_hz": points.frequency,
        "status": [status.name.lower() for status in compared.model.status],
        "converged": bool(np.all(compared.model.ok) and np.all(compared.frictionless.ok)),
        "gap": {name: _gap(entry) for name, entry in gap.items()},
        "channels": {
            name: {
                "unit": CANONICAL_UNITS[name],
                "measured": _measured(points, c),
                "identified": _transfer(model.transfer[:, c], model.peak_to_peak[:, c]),
                "simqc": _transfer(frictionless.transfer[:, c], frictionless.peak_to_peak[:, c]),
            }
            for c, name in enumerate(READINGS)
        },
    }


def _gap(gap: Gap) -> dict[str, float]:
    return {"relative": gap.relative, "floor": gap.floor, "sigma": gap.sigma}


def _measured(points: MeasuredPoints, c: int) -> dict[str, object]:
    return _transfer(points.transfer[:, c], points.peak_to_peak[:, c]) | {
        "per_metre_of_road_sd": points.magnitude_sd[:, c],
        "phase_sd_deg": np.degrees(points.phase_sd[:, c]),
        "peak_to_peak_sd": points.peak_to_peak_sd[:, c],
    }


def _transfer(transfer: NDArray[np.complex128], reach: NDArray[np.float64]) -> dict[str, object]:
    return {
        "per_metre_of_road": np.abs(transfer),
        "phase_deg": np.degrees(np.angle(transfer)),
        "peak_to_peak": reach,
    }
