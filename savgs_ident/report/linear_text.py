"""The linear models of a rig in the terminal."""

from collections.abc import Mapping
from typing import Any

from rich.console import Group, RenderableType

from savgs_ident.report.linear_words import ELEMENT_WORDS
from savgs_ident.report.terminal import figure_of, fixed, plain, table

_SHOWN = (1.0, 2.0, 2.35, 3.0, 6.0)
"""Frequencies whose describing functions are shown [Hz]; all are in the file."""


def linear_text(record: Mapping[str, Any]) -> RenderableType:
    """Tables of what :func:`savgs_ident.report.linear_record.linear_record` says, most important first."""
    return Group(
        _nominal(record),
        _approximations(record),
        _small(record["small_motions"]),
        *_test(record["test_motions"]),
    )


def _nominal(record: Mapping[str, Any]) -> RenderableType:
    rows = [
        (name, figure_of(each["value"], 5), "" if each["unit"] == "1" else each["unit"])
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
