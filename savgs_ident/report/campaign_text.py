"""The content of a campaign as tables for the terminal."""

from typing import Any

from rich.console import Group, RenderableType

from savgs_ident.report.terminal import figure_of, fixed, plain, table

_SHOWN_WARNINGS = 20


def campaign_text(record: dict[str, Any]) -> RenderableType:
    """Tables of channels and dwells, the other tests, and the warnings of an ``inspect`` record."""
    parts: list[RenderableType] = [plain(f"{record['source']}: {_count(record['tests'], 'test')}", "bold")]
    parts.append(_channel_table(record))
    if record["missing_channels"]:
        parts.append(plain("Not recorded: " + ", ".join(record["missing_channels"]) + "\n"))
    if record["dwells"]:
        parts.append(_dwell_table(record["dwells"]))
    parts += [plain(line) for line in _other_tests(record)]
    parts += _warnings(record["source"], record["warnings"])
    return Group(*parts)


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def _channel_table(record: dict[str, Any]) -> RenderableType:
    rows = [
        (
            channel["name"],
            channel["unit"],
            figure_of(channel["rate_hz"]),
            channel["samples"],
            channel["tests"],
            figure_of(channel["standstill_noise"], 3),
            channel["recorded_as"] or "-",
        )
        for channel in record["channels"]
    ]
    headers = ("channel", "unit", "rate\n[Hz]", "samples", "tests", "noise at rest\n(1 sd)", "recorded as")
    return table("Channels", headers, rows, texts=(0, 1, 6))


def _dwell_table(dwells: list[dict[str, Any]]) -> RenderableType:
    rows = [
        (
            dwell["test"],
            fixed(dwell["frequency_hz"], 3),
            dwell["periods"] or "-",
            _reading(dwell, "road_height", "peak_to_peak", 1e3, 2),
            _reading(dwell, "sprung_accel", "peak_to_peak", 1.0, 3),
            _reading(dwell, "sprung_accel", "signal_to_noise", 1.0, 0),
            _highest(dwell, "sprung_accel"),
            _reading(dwell, "susp_deflection", "peak_to_peak", 1e3, 2),
            _reading(dwell, "susp_deflection", "signal_to_noise", 1.0, 0),
            _highest(dwell, "susp_deflection"),
        )
        for dwell in dwells
    ]
    headers = (
        "dwell", "f\n[Hz]", "periods", "road\n[mm]", "accel\n[m/s²]", "S/N\n[1]", "order",
        "defl.\n[mm]", "S/N\n[1]", "order",
    )  # fmt: skip
    title = "Dwells, peak to peak (S/N: signal-to-noise of the first harmonic; order: highest one seen)"
    return table(title, headers, rows)


def _reading(dwell: dict[str, Any], channel: str, key: str, scale: float, places: int) -> str:
    entry = dwell["channels"].get(channel)
    return "-" if entry is None else fixed(scale * float(entry[key]), places)


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


def _warnings(source: str, warnings: list[dict[str, Any]]) -> list[RenderableType]:
    if not warnings:
        return [plain("No warnings.")]
    shown: list[RenderableType] = [plain(_count(len(warnings), "warning"), "bold")]
    # The heading names the source already.
    shown += [
        plain(warning["message"].replace(f"] {source}, ", "] ").replace(f"] {source}: ", "] "))
        for warning in warnings[:_SHOWN_WARNINGS]
    ]
    if len(warnings) > _SHOWN_WARNINGS:
        shown.append(plain(f"... and {len(warnings) - _SHOWN_WARNINGS} more in inspect.json"))
    return shown
