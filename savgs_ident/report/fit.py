"""A fit as a JSON object and in the terminal.

The object of ``fit.json`` is in SI throughout, the unit in the key or beside the value. The terminal shows parameters
with errors, quality, identifiability; the gap between model and measurement.
"""

from math import floor, isfinite, isinf, log10

import numpy as np
from numpy.typing import NDArray
from rich.console import Group, RenderableType

from savgs_ident.core.files import warning_record
from savgs_ident.fit.estimate import Estimate
from savgs_ident.fit.identified import Identified
from savgs_ident.fit.result import (
    Fit,
    Gap,
    chi2_by_dwell,
    entries_by_dwell,
    gaps,
    predicted_peak_to_peak,
    whitened,
)
from savgs_ident.inference.result import UNEXPLAINED
from savgs_ident.report.text import channel_label, counted, fixed, plain, table


def fit_record(fit: Fit) -> dict[str, object]:
    """The contract's keys first, then how the fit went and what is identifiable.

    ``gap`` holds relative rms residuals [1] before and after the fit and of the noise alone ("floor"), and
    the same in noise standard deviations, by channel and "together".
    """
    return {
        "schema": 1,
        "parameters": parameter_records(fit),
        "correlation": correlation_record(fit),
        "chi2": fit.chi2,
        "dof": fit.dof,
        "chi2_per_dof": fit.chi2 / fit.dof if fit.dof > 0 else None,
        "converged": fit.status.ok and all(status.ok for status in fit.dwell_status),
        "trusted": fit.trusted,
        "doubt": fit.doubt or None,
        "gap": gap_record(fit),
        "dwells": _dwell_records(fit),
        "status": fit.status.name.lower(),
        "advice": fit.status.advice,
        "verdict": verdict_record(fit),
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


def parameter_records(fit: Identified) -> dict[str, dict[str, object]]:
    """All estimates by name, in SI."""
    return {
        each.name: {
            "value": each.value,
            "stderr": each.stderr,
            "own_stderr": each.own_stderr,
            "unit": each.unit,
            "free": each.free,
            "prior": each.prior,
            "prior_sd": each.prior_sd,
        }
        for each in fit.estimates
    }


def verdict_record(fit: Identified) -> dict[str, object]:
    """What the data identify."""
    verdict = fit.verdict
    return {
        "explained": verdict.explained,
        "identifiable": verdict.identifiable,
        "sentences": verdict_sentences(fit),
        "confounded": verdict.confounded,
    }


def verdict_sentences(fit: Identified) -> list[str]:
    """Why the fit is not to be trusted, if it is not, and what the data identify."""
    said = fit.doubt == UNEXPLAINED or not fit.doubt
    return [*([] if said else [f"Not to be trusted: {fit.doubt}."]), *fit.verdict.sentences]


def correlation_record(fit: Identified) -> dict[str, dict[str, float]]:
    """Correlations of the estimates [1], by name."""
    names = [each.name for each in fit.estimates]
    rows = fit.correlation.tolist()
    return {name: dict(zip(names, row, strict=True)) for name, row in zip(names, rows, strict=True)}


def _dwell_records(fit: Fit) -> list[dict[str, object]]:
    chi2, entries = chi2_by_dwell(fit), entries_by_dwell(fit)
    sigma = whitened(fit.measured, fit.channels, fit.predicted, fit.used)
    identified = predicted_peak_to_peak(fit.measured, fit.channels, fit.predicted)
    frictionless = predicted_peak_to_peak(fit.measured, fit.channels, fit.frictionless)
    return [
        {
            "test": test,
            "frequency_hz": fit.measured.frequency[d],
            "spacing_hz": fit.measured.spacing[d],
            "status": fit.dwell_status[d].name.lower(),
            "chi2": chi2[d],
            "entries": entries[d],
            "channels": {
                name: _dwell_channel(fit, d, c, sigma[d, c])
                | (_predicted_peaks(identified[d, c], frictionless[d, c]) if d in fit.measured.dwells else {})
                for c, name in enumerate(fit.channels)
                if np.any(fit.used[d, c])
            },
        }
        for d, test in enumerate(fit.measured.tests)
    ]


def _dwell_channel(fit: Fit, d: int, c: int, sigma: NDArray[np.float64]) -> dict[str, object]:
    """The whitened residuals of the orders used, and peak to peak as measured in a dwell."""
    channel = fit.measured.channel(fit.channels[c])
    orders = np.flatnonzero(fit.used[d, c])
    peaks = {
        "peak_to_peak": fit.measured.peak_to_peak[d, channel],
        "peak_to_peak_sd": fit.measured.peak_to_peak_sd[d, channel],
    }
    return {
        **(peaks if d in fit.measured.dwells else {}),
        "residual_rms_sigma": np.sqrt(np.mean(sigma[orders] ** 2)),
        "residual_sigma": {"order": orders, "re": sigma[orders, 0], "im": sigma[orders, 1]},
    }


def _predicted_peaks(identified: float, frictionless: float) -> dict[str, float]:
    """Peak to peak of the model with its effects and without; of windows a part is compared, which has none."""
    return {"peak_to_peak_identified": identified, "peak_to_peak_simqc": frictionless}


_SHOWN_TESTS = 5
_FAR = 2.0


def fit_text(fit: Fit) -> RenderableType:
    """Tables and sentences of a fit, most important first."""
    parts = [
        identified_table(fit),
        _quality(fit),
        *_correlation(fit),
        plain(""),
        _gap_table(fit),
        *tolerance_tables(fit),
        *_far_tests(fit),
        plain("Verdict", "bold"),
        *(plain(f"- {sentence}") for sentence in _verdict(fit)),
    ]
    return Group(*parts)


def value_with_error(value: float, error: float) -> str:
    """A value to the second significant digit of its error, ``0.03001 ± 0.00012``.

    Both are in the same unit.
    """
    if isinf(error):
        return f"{value:.3g}, not identified"
    if not error > 0.0:
        return f"{value:.6g}"
    places = min(max(1 - floor(log10(error)), 0), 12)
    return f"{value:.{places}f} ± {error:.{places}f}"


def identified_table(fit: Identified) -> RenderableType:
    """The identified parameters with their errors."""
    rows = [
        (
            each.name,
            value_with_error(each.value, each.stderr),
            "" if each.unit == "1" else each.unit,
            fixed(100.0 * each.stderr / abs(each.value), 2) if each.value and isfinite(each.stderr) else "-",
            _about(fit, each.name),
        )
        for each in fit.estimates
        if each.free
    ]
    headers = ("parameter", "value ± 1 sd", "unit", "sd [%]", "description")
    return table("Identified parameters", headers, rows, texts=(0, 2, 4))


def _quality(fit: Fit) -> RenderableType:
    ratio = f" = {fit.chi2 / fit.dof:.3f}" if fit.dof > 0 else ""
    return plain(
        f"chi2/dof = {fit.chi2:.1f}/{fit.dof}{ratio} on {_compared(fit)} (computed in {fit.wall_s:.1f} s)"
    )


def _compared(fit: Fit) -> str:
    dwells, windows = fit.measured.dwells, fit.measured.windows
    if fit.quantity == "peak_to_peak":
        return f"peak-to-peak values of {counted(dwells.size, 'dwell')}"
    compared = []
    if dwells.size:
        orders = np.flatnonzero(fit.used[dwells].any(axis=(0, 1)))
        compared.append(f"harmonics of orders 1 to {orders[-1]} of {counted(dwells.size, 'dwell')}")
    if windows.size:
        places = np.flatnonzero(fit.used[windows].any(axis=(0, 1)))
        hertz = places * float(fit.measured.spacing[windows[0]])
        compared.append(
            f"{hertz.size} frequencies from {hertz[0]:.2g} to {hertz[-1]:.3g} Hz of {counted(windows.size, 'window')}"
        )
    return " and ".join(compared)


def _about(fit: Identified, name: str) -> str:
    """What a parameter is, in a few words."""
    return fit.estimated.table[name].about.split(",")[0]


def _correlation(fit: Fit) -> list[RenderableType]:
    """The free parameters that trade off most against each other."""
    names = fit.free_names
    pairs = [(one, other) for one in range(len(names)) for other in range(one)]
    known = [pair for pair in pairs if isfinite(fit.correlation[pair])]
    if not known:
        return []
    one, other = max(known, key=lambda pair: abs(fit.correlation[pair]))
    return [
        plain(f"Strongest correlation: {names[other]} with {names[one]}, {fit.correlation[one, other]:+.2f}")
    ]


def _gap_table(fit: Fit) -> RenderableType:
    rows = [
        (
            channel_label(name, fit.model).title,
            fixed(100.0 * entry["before"], 2),
            fixed(100.0 * entry["after"], 3),
            fixed(100.0 * entry["floor"], 3),
            fixed(entry["before_sigma"], 1),
            fixed(entry["after_sigma"], 2),
        )
        for name, entry in gap_record(fit).items()
    ]
    headers = ("residual (rms)", "before\n[%]", "after\n[%]", "noise\n[%]", "before\n[sd]", "after\n[sd]")
    return table("Gap between measurement and model", headers, rows)


def tolerance_tables(fit: Identified) -> list[RenderableType]:
    """What was known to a tolerance and has changed by half of one or more, and numbers that were typical alone."""
    along = [each for each in fit.estimates if not each.free]
    return [*_tolerated([each for each in along if each.prior_sd > 0.0]), *_typical(along)]


def _typical(along: list[Estimate]) -> list[RenderableType]:
    rows = [
        (each.name, f"{each.prior:.3g}", value_with_error(each.value, each.stderr), each.unit)
        for each in along
        if each.prior_sd == 0.0
    ]
    headers = ("parameter", "typical", "estimate ± 1 sd", "unit")
    title = "Known to an order of magnitude, and estimated too"
    return [table(title, headers, rows, texts=(0, 3))] if rows else []


def _tolerated(known: list[Estimate]) -> list[RenderableType]:
    if not known:
        return []
    moved = sorted((each for each in known if _shift(each) >= 0.5), key=_shift, reverse=True)
    rows = [
        (
            each.name,
            value_with_error(each.prior, each.prior_sd),
            value_with_error(each.value, each.stderr),
            each.unit,
            f"{(each.value - each.prior) / each.prior_sd:+.1f}",
        )
        for each in moved
    ]
    title = (
        f"Known to a tolerance and estimated too: {len(known)},"
        f" of which {len(moved)} changed by half a tolerance or more"
    )
    if not moved:
        return [plain(title), plain("")]
    headers = ("parameter", "drawing ± 1 sd", "estimate ± 1 sd", "unit", "change\n[sd]")
    return [table(title, headers, rows, texts=(0, 3))]


def _shift(each: Estimate) -> float:
    return abs(each.value - each.prior) / each.prior_sd


def _far_tests(fit: Fit) -> list[RenderableType]:
    """The tests with the largest misfit, where it is large."""
    chi2 = chi2_by_dwell(fit)
    ratio = chi2 / entries_by_dwell(fit).clip(1)
    bad = [
        d
        for d in sorted(range(len(ratio)), key=lambda d: -ratio[d])
        if ratio[d] > _FAR or not fit.dwell_status[d].ok
    ]
    if not bad:
        return []
    rows = [
        (
            fit.measured.tests[d],
            fixed(float(fit.measured.frequency[d]) if d in fit.measured.dwells else None, 3),
            fixed(float(ratio[d]), 2),
            fit.dwell_status[d].name.lower().replace("_", " "),
        )
        for d in bad[:_SHOWN_TESTS]
    ]
    title = f"Tests with the largest misfit (chi2 per entry above {_FAR:g}, or not solved): {len(bad)}"
    return [table(title, ("test", "f\n[Hz]", "chi2 per\nentry", "solution"), rows, texts=(0, 3))]


def _verdict(fit: Fit) -> list[str]:
    failed = [
        test for test, status in zip(fit.measured.tests, fit.dwell_status, strict=True) if not status.ok
    ]
    unsolved = [f"The model's motion was not found in: {', '.join(failed)}."] if failed else []
    return unsolved + verdict_sentences(fit)
