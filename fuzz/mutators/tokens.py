"""Texts that stand where a value belongs, and that some reader somewhere was not prepared for."""

NUMBERS = (
    "0", "-1", "1e308", "-1e308", "5e-324", "9223372036854775808", "9" * 400, "9" * 5000, "0.1", "-0.0", "1e-300",
)  # fmt: skip
"""Numbers of every size, in JSON and TOML."""

TEXTS = (
    '""', '"nan"', '"x"', '"../../../etc/passwd"', '"/dev/zero"', '"<script>alert(1)</script>&amp;"',
    r'"\u001b[31m\u0000\u0007"', r'"two\nlines"', r'"\u2028\u202e"', '"' + "x" * 200_000 + '"', '"mu_r"',
    '"__class__"', '"[bold]{0}%s"',
)  # fmt: skip
"""Texts, in JSON and TOML."""

DEPTHS = (30, 300, 480, 2000, 100_000)

NESTED = tuple("[" * depth + "]" * depth for depth in DEPTHS)
"""Lists within lists, in JSON and TOML."""

SHARED = (*NUMBERS, *TEXTS, *NESTED, "[]", "{}", "true", "false", "[[]]", "[1, [2, [3]]]", '["a", 1]')
"""Values of both forms."""

JSON = (
    *SHARED, "null", "NaN", "Infinity", "-Infinity", "1e999", r'"\ud800"', '{"a": {"b": null}}', "[null]", "[NaN]",
    *('{"a":' * depth + "1" + "}" * depth for depth in DEPTHS),
)  # fmt: skip
"""Values of JSON, and what Python's reader takes for such."""

TOML = (
    *SHARED, "nan", "inf", "-inf", "1979-05-27T07:32:00Z", "07:32:00", "1979-05-27", "0x7fffffffffffffff", "[nan]",
    *("{a=" * depth + "1" + "}" * depth for depth in DEPTHS),
)  # fmt: skip
"""Values of TOML."""

CELLS = (
    "", "nan", "NaN", "inf", "-inf", "1e999", "1e308", "-1e308", "5e-324", "0x1F", "1,5", '"', '""', '"a', "x", "-",
    " ", "#", "\x00", "\x1b[31m", "9" * 400, "x" * 5000, "<b>", "=1+1", "\u0661", "\ufeff", "True", "1_000", "--1",
    "../../x", "\r", "\u2028", "1e+-5",
)  # fmt: skip
"""Cells of a table."""

HEADERS = (
    "time", "time [s]", "time [ms]", "road_height [mm]", "sprung_accel [g]", "deflection [parsec]", "test", "[m]",
    "[", "", "1.0", "link_angle [deg]", "x [\x1b]", "y" * 3000, "time [", '"', "susp_deflection [m]", "t [us]",
)  # fmt: skip
"""Headers of a column."""
