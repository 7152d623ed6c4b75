"""Files that are no rig file are refused with file, key, what is wrong and the remedy."""

from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from savgs_ident.core.errors import InputError
from savgs_ident.plants.quarter_car.rig import Rig, default_rig_path, read_rig
from savgs_ident.plants.quarter_car.rig_toml import SECTION_OF

from ...in_one_test import over

SHIPPED = default_rig_path().read_text(encoding="utf-8")


def _line(name: str) -> str:
    return next(line for line in SHIPPED.splitlines() if line.startswith(f"{name} = "))


def _edit(old: str, new: str) -> Callable[[], str]:
    def edit() -> str:
        assert SHIPPED.count(old) == 1, old
        return SHIPPED.replace(old, new)

    return edit


def _in_line(name: str, old: str, new: str) -> Callable[[], str]:
    assert old in _line(name), (name, old)
    return _edit(_line(name), _line(name).replace(old, new, 1))


FAULTS: dict[str, tuple[Callable[[], str], str, str]] = {
    "empty": (lambda: "", "schema is missing", "schema = 1"),
    "not TOML": (lambda: "m_s is 320 kg", "not valid TOML", "mend it"),
    "nested without end": (lambda: "x = " + "[" * 100_000, "not valid TOML", "mend it"),
    "number without end": (lambda: "x = " + "9" * 5_000, "not valid TOML", "mend it"),
    "other schema": (_edit("schema = 1", "schema = 2"), "schema is 2", "schema = 1"),
    "schema as a truth": (_edit("schema = 1", "schema = true"), "schema is True", "schema = 1"),
    "no name": (_edit('name = "gt_rear"', ""), "name is missing", "name ="),
    "name a number": (_edit('name = "gt_rear"', "name = 3"), "name is missing or not a text", "name ="),
    "unknown section": (_edit("[rail]", "[railway]"), "railway is not known", "rail"),
    "missing section": (_edit("[road]\n", "[sensors.road]\n"), "sensors.road is not known", "accel_gain"),
    "no damper": (lambda: SHIPPED[: SHIPPED.index("\n[damper]")], "section [damper] is missing", "example"),
    "empty section": (_edit(_line("cam_peak_to_peak"), ""), "road.cam_peak_to_peak is missing", "'m'"),
    "section a number": (_edit("schema = 1", "schema = 1\nprovenance = 3"), "[provenance] is 3", "shipped"),
    "missing parameter": (_edit(_line("k_t"), ""), "tyre.k_t is missing", "'N/m'"),
    "unknown parameter": (_edit(_line("k_t"), "k_tyre = 3\n" + _line("k_t")), "tyre.k_tyre is", "k_t"),
    "wrong section": (_edit(_line("k_t"), _line("k_t") + "\n" + _line("l_tb")), "tyre.l_tb", "[rail]"),
    "given twice": (_edit(_line("k_t"), _line("k_t") + "\n" + _line("k_t")), "not valid TOML", "mend it"),
    "bare number": (_edit(_line("m_s"), "m_s = 320.0"), "masses.m_s is 320.0, not a table", "with its unit"),
    "no value": (_in_line("m_s", "value = 320.0, ", ""), "masses.m_s.value is missing", "'kg'"),
    "no unit": (_in_line("m_s", 'unit = "kg", ', ""), "masses.m_s.unit is missing", "'kg'"),
    "wrong unit": (_in_line("l_SL", '"m"', '"mm"'), "link.l_SL is given in 'mm'", "convert it to 'm'"),
    "unit a number": (_in_line("l_SL", '"m"', "1"), "link.l_SL.unit is 1, not a text", "quotes"),
    "value a text": (_in_line("m_s", "320.0", '"320"'), "masses.m_s.value is '320', not a number", "SI"),
    "value a truth": (_in_line("m_s", "320.0", "true"), "masses.m_s.value is True, not a number", "SI"),
    "value nan": (_in_line("m_s", "320.0", "nan"), "masses.m_s.value is not a number (nan)", "finite"),
    "value infinite": (_in_line("m_s", "320.0", "inf"), "masses.m_s: parameter 'm_s' is inf", "finite"),
    "value too large": (_in_line("m_s", "320.0", "9" * 400), "masses.m_s.value is larger", "fits"),
    "bound nan": (_in_line("m_s", "lower = 0.0", "lower = nan"), "masses.m_s.lower is not", "finite"),
    "outside bounds": (_in_line("m_s", "320.0", "-320.0"), "masses.m_s: parameter 'm_s' = -320.0", "bounds"),
    "negative tolerance": (_in_line("m_s", "1.6", "-1.6"), "has tolerance -1.6", "zero or positive"),
    "unknown field": (_in_line("m_s", "tolerance", "sigma"), "masses.m_s.sigma is not known", "tolerance"),
    "about a number": (_in_line("m_s", '"sprung mass"', "1"), "masses.m_s.about is 1, not a text", "quotes"),
    "no upright left": (_in_line("m_u", "49.0", "6.0"), "leaves nothing for the upright", "whole unsprung"),
    "damper falls": (_edit("62.0, 147.0", "147.0, 62.0"), "damper.force falls at 0.025 m/s", "never falling"),
    "damper goes back": (_edit("0.01, 0.025", "0.025, 0.01"), "does not increase at 0.01 m/s", "increasing"),
    "damper off zero": (_edit("-100.0, 0.0, 62.0", "-100.0, 1.0, 62.0"), "does not pass through", "(0, 0)"),
    "damper short": (_edit("2957.0, 4285.0", "2957.0"), "27 velocities and 26 forces", "(0, 0)"),
    "damper with a text": (_edit("-5906.0", '"-5906"'), "damper.force.values[0] is '-5906'", "SI"),
    "damper infinite": (_edit("-5906.0", "-inf"), "damper has a value that is not finite", "finite"),
    "damper not a list": (_edit("values = [\n    -1.5", "x = [\n    -1.5"), "damper.velocity.x is", "values"),
    "damper in km/h": (_edit('"m/s"\nabout', '"km/h"\nabout'), "damper.velocity is given in 'km/h'", "'m/s'"),
    "effect, known name": (lambda: SHIPPED + f"[effects]\n{_line('k_t')}", "effects.k_t stands in", "[tyre]"),
    "effect, odd unit": (lambda: SHIPPED + '[effects]\na = {value = 1, unit = "mm"}', "unit 'mm'", "m/N"),
    "effect, odd name": (lambda: SHIPPED + '[effects]\n"a b" = {value = 1, unit = "m"}', "'a b'", "letters"),
}  # fmt: skip


@over("fault", FAULTS)
def test_a_faulty_file_is_refused_with_file_key_and_remedy(fault: str, tmp_path: Path) -> None:
    make, what, remedy = FAULTS[fault]
    path = tmp_path / "faulty.toml"
    path.write_text(make(), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_rig(path)
    assert caught.value.source == str(path)
    assert what in caught.value.what
    assert remedy in caught.value.remedy


def test_what_is_no_readable_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read: No such file"):
        read_rig(tmp_path / "none.toml")
    with pytest.raises(InputError, match="cannot be read: Is a directory"):
        read_rig(tmp_path)
    (tmp_path / "latin.toml").write_bytes(SHIPPED.encode().replace(b"sprung", b"spr\xfcng"))
    with pytest.raises(InputError, match="not text in UTF-8"):
        read_rig(tmp_path / "latin.toml")


def _read(path: Path) -> Rig | InputError:
    try:
        return read_rig(path)
    except InputError as error:
        return error


@given(start=st.integers(0, len(SHIPPED)), length=st.integers(0, 60), patch=st.text(max_size=20))
def test_any_damage_gives_a_rig_or_an_input_error(
    tmp_path_factory: pytest.TempPathFactory, start: int, length: int, patch: str
) -> None:
    path = tmp_path_factory.getbasetemp() / "damaged.toml"
    path.write_text(SHIPPED[:start] + patch + SHIPPED[start + length :], encoding="utf-8", newline="")
    outcome = _read(path)
    if isinstance(outcome, InputError):
        assert outcome.remedy
        assert outcome.source == str(path)
    else:
        assert set(SECTION_OF) <= set(outcome.parameters)
