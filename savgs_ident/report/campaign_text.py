"""The content of a campaign as tables for the terminal."""

from typing import Any

from rich.console import Group, RenderableType

from savgs_ident.report.campaign_summary import READINGS
from savgs_ident.report.terminal import figure_of, plain, table

_SHOWN_WARNINGS = 20


def campaign_text(record: dict[str, Any]) -> RenderableType:
    """Tables of channels and dwells, the other tests, and the warnings of an ``inspect`` record."""
    parts = [plain(f"{record['source']}: {_count(record['tests'], 'test')}", "bold"), plain("")]
    parts.append(_channel_table(record))
    if record["missing_channels"]:
        parts.append(plain("Not recorded: " + ", ".join(record["missing_channels"]) + "\n"))
    if record["dwells"]:
        parts.append(_dwell_table(record["dwells"]))
    parts += [plain(line) for line in _other_tests(record)]
    parts += [plain(""), *_warnings(record["warnings"])]
    return Group(*parts)


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def _channel_table(record: dict[str, Any]) -> RenderableType:
    rows = [
        (
            channel["name"],
            channel["recorded_as"] or "-",
            channel["unit"],
            figure_of(channel["rate_hz"]),
            channel["samples"],
            channel["tests"],
            figure_of(channel["standstill_noise"], 3),
        )
        for channel in record["channels"]
    ]
    headers = ("channel", "recorded as", "unit", "rate [Hz]", "samples", "tests", "noise at rest (1 sd)")
    return table("Channels", headers, rows, left=3)


def _dwell_table(dwells: list[dict[str, Any]]) -> RenderableType:
    rows = []
    for dwell in dwells:
        cells = [dwell["test"], figure_of(dwell["frequency_hz"], 5), dwell["periods"] or "-"]
        cells.append(_reading(dwell, "road_height", "peak_to_peak", 1e3, 4))
        for name in READINGS:
            cells.append(_reading(dwell, name, "peak_to_peak", 1e3 if name == "susp_deflection" else 1.0, 4))
            cells.append(_reading(dwell, name, "signal_to_noise", 1.0, 3))
            cells.append(_highest(dwell, name))
        rows.append(cells)
    headers = (
        "dwell", "f [Hz]", "periods", "road p-p [mm]",
        "accel p-p [m/s²]", "S/N", "order", "deflection p-p [mm]", "S/N", "order",
    )  # fmt: skip
    title = "Dwells (p-p: peak to peak; S/N: of the first harmonic; order: highest one seen)"
    return table(title, headers, rows)


def _reading(dwell: dict[str, Any], channel: str, key: str, scale: float, digits: int) -> str:
    entry = dwell["channels"].get(channel)
    return "-" if entry is None else figure_of(scale * float(entry[key]), digits)


def _highest(dwell: dict[str, Any], channel: str) -> str:
    seen = dwell["channels"].get(channel, {}).get("orders_seen")
    return str(seen[-1]) if seen else "-"


def _other_tests(record: dict[str, Any]) -> list[str]:
    lines = []
    for sweep in record["sweeps"]:
        span = sweep["frequency_hz"]
        reach = f", response from {span[0]:.2f} to {span[1]:.2f} Hz" if span else ""
        lines.append(f"Sweep {sweep['test']}: {sweep['duration_s']:.1f} s{reach}")
    lines += [f"Standstill {each['test']}: {each['duration_s']:.1f} s" for each in record["standstills"]]
    lines += [f"Other {each['test']}: {each['duration_s']:.1f} s" for each in record["others"]]
    return lines


def _warnings(warnings: list[dict[str, Any]]) -> list[RenderableType]:
    if not warnings:
        return [plain("No warnings.")]
    shown: list[RenderableType] = [plain(_count(len(warnings), "warning"), "bold")]
    shown += [plain(warning["message"]) for warning in warnings[:_SHOWN_WARNINGS]]
    if len(warnings) > _SHOWN_WARNINGS:
        shown.append(plain(f"... and {len(warnings) - _SHOWN_WARNINGS} more in inspect.json"))
    return shown
