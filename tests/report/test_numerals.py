"""Printed numbers are right to a tenth of their error, and look the same in a pair."""

import re

from hypothesis import given
from hypothesis import strategies as st

from savgs_ident.report.text import (
    MINUS,
    count,
    decimal,
    interval,
    numeral,
    percentage,
    signed,
    unit_text,
    with_error,
)

SUPERSCRIPTS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹" + MINUS, "-0123456789-", "\u202f")


def read_back(text: str) -> float:
    number, _, power = text.translate(SUPERSCRIPTS).partition(" \u00d7 10")
    return float(number) * 10.0 ** int(power or 0)


def test_a_number_has_the_digits_of_its_error() -> None:
    for value, error, text in (
        (0.030018, 0.00012, "0.03002"),
        (5386.23, 9.7, "5386.2"),
        (264123.0, 1300.0, "264\u202f123"),
        (-0.25, 0.031, "\u22120.250"),
        (9996111.0, 170484.0, "10.00 \u00d7 10⁶"),
        (0.0000298, 0.0000031, "2.98 \u00d7 10⁻⁵"),
        (0.0, 0.5, "0.00"),
        (5e-324, 1.0, "0.0"),
        (0.2512, float("inf"), "0.2512"),
        (float("inf"), 1.0, "∞"),
        (float("nan"), 1.0, "unknown"),
    ):
        assert numeral(value, error) == text


@given(st.floats(-1e9, 1e9), st.floats(1e-9, 1e9))
def test_a_printed_number_is_right_to_a_tenth_of_its_error(value: float, error: float) -> None:
    shown = read_back(numeral(value, error))
    assert abs(shown - value) <= max(
        0.1 * error, 0.5e-12 * max(abs(value), 1.0), 0.5 if error >= 10.0 else 0.0
    )


@given(st.floats(1e-8, 1e8), st.floats(0.001, 0.3))
def test_value_and_error_share_their_decimals_and_their_power(value: float, relative: float) -> None:
    text = with_error(value, relative * value)
    numbers = re.sub(r"[()\u202f]", "", text.split(" \u00d7 ")[0]).split(" ± ")
    decimals = {len(number.partition(".")[2]) for number in numbers}
    assert len(decimals) == 1
    assert text.count("\u00d7 10") <= 1


def test_intervals_percentages_and_counts() -> None:
    assert interval(-0.0025, 0.0113, 0.0031) == "\u22120.0025 to 0.0113"
    assert interval(1.1e7, 1.3e7, 5e5) == "(1.100 to 1.300) \u00d7 10⁷"
    assert percentage(0.994) == "99.4 %"
    assert (percentage(0.9998), percentage(1.0), percentage(0.997, 0)) == ("> 99.9 %", "100.0 %", "> 99 %")
    assert percentage(float("nan")) == "\u2013"
    assert count(12345.4) == "12\u202f345"
    assert count(float("nan")) == "\u2013"
    assert decimal(1.0034, 3) == "1.003"
    assert decimal(float("nan"), 3) == decimal(float("inf"), 3) == "\u2013"
    assert (signed(0.004, 2), signed(-0.004, 2), signed(-0.87, 2), signed(0.87, 1)) == (
        "0.00",
        "0.00",
        "\u22120.87",
        "+0.9",
    )


def test_units_are_printed_as_people_write_them() -> None:
    assert [unit_text(unit) for unit in ("1", "m/s^2", "kg m^2", "N s/m")] == [
        "\u2013",
        "m/s²",
        "kg m²",
        "N s/m",
    ]
