"""A fit in the terminal: parameters with errors, quality, identifiability; the gap between model and measurement."""

from math import floor, isfinite, isinf, log10
from typing import Any

from rich.console import Group, RenderableType

from savgs_ident.fit.residuals import chi2_by_dwell, entries_by_dwell
from savgs_ident.fit.result import Estimate, Fit
from savgs_ident.plants.model import Model
from savgs_ident.report.fit.record import gap_record
from savgs_ident.report.text import channel_label, fixed, plain, table

_SHOWN_DWELLS = 5
_FAR = 2.0


def fit_text(fit: Fit) -> RenderableType:
    """Tables and sentences of a fit, most important first."""
    parts = [
        _identified(fit),
        _quality(fit),
        *_correlation(fit),
        plain(""),
        _gap_table(fit),
        *_tolerances(fit),
        *_dwells(fit),
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


def _identified(fit: Fit) -> RenderableType:
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
    what = (
        "peak-to-peak values" if fit.quantity == "peak_to_peak" else f"harmonics of orders 1 to {fit.orders}"
    )
    return plain(
        f"chi2/dof = {fit.chi2:.1f}/{fit.dof}{ratio} on {what} of {len(fit.measured.tests)} dwells"
        f" ({fit.wall_s:.1f} s)"
    )


def _about(fit: Fit, name: str) -> str:
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


def _tolerances(fit: Fit) -> list[RenderableType]:
    known = [each for each in fit.estimates if not each.free]
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


def _dwells(fit: Fit) -> list[RenderableType]:
    """The dwells with the largest misfit, where it is large."""
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
            fixed(float(fit.measured.frequency[d]), 3),
            fixed(float(ratio[d]), 2),
            fit.dwell_status[d].name.lower().replace("_", " "),
        )
        for d in bad[:_SHOWN_DWELLS]
    ]
    title = f"Dwells with the largest misfit (chi2 per entry above {_FAR:g}, or not solved): {len(bad)}"
    return [table(title, ("dwell", "f\n[Hz]", "chi2 per\nentry", "solution"), rows, texts=(0, 3))]


def _verdict(fit: Fit) -> list[str]:
    sentences = [] if fit.status.ok else [f"The fit is not to be trusted: {fit.status.advice}."]
    failed = [
        test for test, status in zip(fit.measured.tests, fit.dwell_status, strict=True) if not status.ok
    ]
    if failed:
        sentences.append("The model's periodic motion was not found in: " + ", ".join(failed) + ".")
    return sentences + list(fit.verdict.sentences)


def bode_text(record: dict[str, Any], model: Model) -> RenderableType:
    """The gap by channel, and the dwells that were not solved."""
    rows = [
        (
            channel_label(name, model).title,
            fixed(100.0 * gap["relative"], 3),
            fixed(100.0 * gap["floor"], 3),
            fixed(gap["sigma"], 2),
        )
        for name, gap in record["gap"].items()
    ]
    count = len(record["tests"])
    parts = [
        table(
            f"Residual of the model on {count} dwells (rms)",
            ("channel", "residual\n[%]", "noise\n[%]", "residual\n[noise sd]"),
            rows,
        )
    ]
    failed = [
        test for test, status in zip(record["tests"], record["status"], strict=True) if status != "converged"
    ]
    if failed:
        parts.append(plain("The model's periodic motion was not found in: " + ", ".join(failed)))
    return Group(*parts)
