"""An H-infinity design in the terminal."""

from collections.abc import Mapping
from math import isfinite
from typing import Any

from rich.console import Group, RenderableType

from savgs_ident.report.design_words import WEIGHT_WORDS
from savgs_ident.report.terminal import figure_of, fixed, plain, table


def design_text(record: Mapping[str, Any]) -> RenderableType:
    """Tables of what :func:`savgs_ident.report.design_record.design_record` says, most important first."""
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
            figure_of(_finite(each["gain_up"]), 3),
            figure_of(_finite(each["gain_down"]), 3),
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
    rows = [(name, figure_of(each["value"]), each["unit"], each["about"]) for name, each in weights.items()]
    return table("Weights", ("weight", "value", "unit", "what it is"), rows, (0, 2, 3))


def _finite(value: float | None) -> float | None:
    """A number, None where it is not finite."""
    return value if value is not None and isfinite(value) else None


def _milliseconds(seconds: float | None) -> str:
    finite = _finite(seconds)
    return fixed(None if finite is None else 1e3 * finite, 1)
