"""A model held against a measurement, as a JSON object and in the terminal.

The object of ``bode.json`` is in SI throughout, the unit in the key or beside the value. The terminal shows the gap
between model and measurement.
"""

import numpy as np
from numpy.typing import NDArray
from rich.console import Group, RenderableType

from savgs_ident.fit.public import Comparison
from savgs_ident.fit.result import Gap, MeasuredPoints, OverWindows, gaps, measured_points, recorded_spectra
from savgs_ident.report.text import channel_label, fixed, per_input_key, plain, table, tests_counted
from savgs_ident.responses.selection import by_kind


def bode_record(compared: Comparison) -> dict[str, object]:
    """The JSON object of ``bode``, in SI.

    Of dwells it holds first harmonics per unit of the input, phase against it, in the order of the tests that are
    dwells; of windows root mean squares over them at each frequency, under a key of their own beside dwells.
    """
    dwells, windows = by_kind(compared)
    channels = {} if dwells is None else {"channels": _first_harmonics(dwells)}
    if windows is not None:
        channels["channels" if dwells is None else "channels_in_windows"] = _spectra(windows)
    return {
        "schema": 1,
        "effects": list(compared.effects),
        "tests": compared.measured.tests,
        "frequency_hz": compared.measured.frequency,
        "spacing_hz": compared.measured.spacing,
        "kind": [
            "dwell" if d in compared.measured.dwells else "window"
            for d in range(len(compared.measured.tests))
        ],
        "status": [status.name.lower() for status in compared.model.status],
        "converged": compared.trusted,
        "gap": {name: _gap_entry(gap) for name, gap in _gaps(compared).items()},
        **channels,
    }


def _first_harmonics(compared: Comparison) -> dict[str, object]:
    given = compared.given
    names, key = [each.name for each in given.channels], per_input_key(given)
    points = measured_points(compared.measured, names, given.plant.inputs[0].name)
    model, frictionless = compared.model.curve(""), compared.frictionless.curve("")
    return {
        each.name: {
            "unit": each.unit,
            "measured": _measured(points, c, key),
            "identified": _transfer(model.transfer[:, c], model.peak_to_peak[:, c], key),
            "simqc": _transfer(frictionless.transfer[:, c], frictionless.peak_to_peak[:, c], key),
        }
        for c, each in enumerate(given.channels)
    }


def _spectra(compared: Comparison) -> dict[str, object]:
    return {
        each.name: {"unit": each.unit, **_spectrum(compared, c, each.name)}
        for c, each in enumerate(compared.given.channels)
        if each.name in compared.measured.channels
    }


def _spectrum(compared: Comparison, c: int, name: str) -> dict[str, NDArray[np.float64]]:
    over = OverWindows.of(compared.measured, compared.used[:, c])
    recorded, noise = recorded_spectra(compared.measured, name, compared.used.shape[2])
    model, frictionless = compared.model.harmonics[:, c], compared.frictionless.harmonics[:, c]
    values = {"measured": recorded, "identified": model, "simqc": frictionless, "missed": recorded - model}
    found = {f"{key}_rms": over.rms(np.abs(each) ** 2) for key, each in values.items()}
    return {"frequency_hz": over.frequency, **found, "noise_rms": over.rms(noise)}


def _gaps(compared: Comparison) -> dict[str, Gap]:
    names = [each.name for each in compared.given.channels]
    return gaps(compared.measured, names, compared.model.harmonics, compared.used)


def _gap_entry(gap: Gap) -> dict[str, float]:
    return {"relative": gap.relative, "floor": gap.floor, "sigma": gap.sigma}


def _measured(points: MeasuredPoints, c: int, key: str) -> dict[str, object]:
    return _transfer(points.transfer[:, c], points.peak_to_peak[:, c], key) | {
        f"{key}_sd": points.magnitude_sd[:, c],
        "phase_sd_deg": np.degrees(points.phase_sd[:, c]),
        "peak_to_peak_sd": points.peak_to_peak_sd[:, c],
    }


def _transfer(
    transfer: NDArray[np.complex128], peak_to_peak: NDArray[np.float64], key: str
) -> dict[str, object]:
    return {
        key: np.abs(transfer),
        "phase_deg": np.degrees(np.angle(transfer)),
        "peak_to_peak": peak_to_peak,
    }


def bode_text(compared: Comparison) -> RenderableType:
    """The gap by channel, and the dwells or windows that were not solved."""
    rows = [
        (
            channel_label(name, compared.given).title,
            fixed(100.0 * gap.relative, 3),
            fixed(100.0 * gap.floor, 3),
            fixed(gap.sigma, 2),
        )
        for name, gap in _gaps(compared).items()
    ]
    measured, tests = compared.measured, compared.measured.tests
    headers = ("channel", "residual\n[%]", "noise\n[%]", "residual\n[noise sd]")
    parts = [table(f"Residual of the model on {tests_counted(measured)} (rms)", headers, rows)]
    failed = [test for test, status in zip(tests, compared.model.status, strict=True) if not status.ok]
    if failed:
        parts.append(plain("The model's motion was not found in: " + ", ".join(failed)))
    return Group(*parts)
