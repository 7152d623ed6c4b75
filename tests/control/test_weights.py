"""Files of weights: what they change is changed, and anything that is no weight is refused."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from savgs_ident.control.weights import DEFAULT_WEIGHTS, read_weights
from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import ParameterTable

NAMES = tuple(DEFAULT_WEIGHTS)
TEXT = "".join(
    f'{each.name} = {{ value = {each.value}, unit = "{each.unit}" }}\n' for each in DEFAULT_WEIGHTS.entries
)


def _read(path: Path, text: str) -> ParameterTable:
    path.write_bytes(text.encode(errors="replace"))
    return read_weights(path)


def test_a_file_of_all_the_weights_that_come_along_changes_nothing(tmp_path: Path) -> None:
    assert _read(tmp_path / "weights.toml", TEXT) == DEFAULT_WEIGHTS
    assert _read(tmp_path / "weights.toml", "") == DEFAULT_WEIGHTS


@given(name=st.sampled_from(NAMES), value=st.floats(1e-2, 1e3))
def test_a_weight_in_the_file_is_the_only_one_that_changes(
    tmp_path_factory: pytest.TempPathFactory, name: str, value: float
) -> None:
    path = tmp_path_factory.getbasetemp() / "one.toml"
    found = _read(path, f'{name} = {{ value = {value!r}, unit = "{DEFAULT_WEIGHTS[name].unit}" }}')
    assert found.as_dict() == DEFAULT_WEIGHTS.as_dict() | {name: value}


FAULTS = {
    "no TOML": ("accel_bound is 2", "not valid TOML", "mend"),
    "nested without end": ("x = " + "[" * 100_000, "not valid TOML", "mend"),
    "no text": ("accel_bound = \udcff", "no", ""),
    "unknown": ("jerk_bound = 3", "no weight 'jerk_bound'", "accel_bound"),
    "a table of weights": ("[weights]\naccel_bound = 3", "no weight 'weights'", "accel_bound"),
    "bare number": ("accel_bound = 2.0", "no value with a unit", 'unit = "m/s^2"'),
    "no unit": ("accel_bound = { value = 2.0 }", "no value with a unit", 'unit = "m/s^2"'),
    "one more field": ('drift = { value = 1, unit = "m/s", why = "" }', "no value with a unit", '"m/s"'),
    "another unit": ('accel_corner = { value = 5, unit = "rad/s" }', "no number in 'Hz'", '"Hz"'),
    "a unit that is a number": ("accel_corner = { value = 5, unit = 1 }", "no number in 'Hz'", '"Hz"'),
    "a text": ('accel_bound = { value = "2", unit = "m/s^2" }', "no number", "value"),
    "a truth": ('accel_bound = { value = true, unit = "m/s^2" }', "no number", "value"),
    "a list": ('accel_bound = { value = [2], unit = "m/s^2" }', "no number", "value"),
    "zero": ('noise_accel = { value = 0, unit = "m/s^2" }', "outside its bounds", ""),
    "negative": ('drift = { value = -1.0, unit = "m/s" }', "outside its bounds", ""),
    "nan": ('drift = { value = nan, unit = "m/s" }', "is nan", "finite"),
    "infinite": ('drift = { value = inf, unit = "m/s" }', "is inf", "finite"),
    "huge": ("drift = { value = 1" + "0" * 400 + ', unit = "m/s" }', "larger than any number", "value"),
    "twice": (TEXT + TEXT, "not valid TOML", "mend"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_faulty_file_is_refused_with_what_is_wrong_and_a_remedy(fault: str, tmp_path: Path) -> None:
    text, what, remedy = FAULTS[fault]
    path = tmp_path / "weights.toml"
    with pytest.raises(InputError) as caught:
        _read(path, text)
    assert caught.value.source == str(path)
    assert what in caught.value.what
    assert remedy in caught.value.remedy
    assert caught.value.remedy


def test_what_is_no_readable_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read: No such file"):
        read_weights(tmp_path / "none.toml")
    with pytest.raises(InputError, match="cannot be read: Is a directory"):
        read_weights(tmp_path)
    (tmp_path / "latin.toml").write_bytes(b'drift = { value = 1, unit = "\xb5m/s" }')
    with pytest.raises(InputError, match="not valid TOML"):
        read_weights(tmp_path / "latin.toml")


def _outcome(path: Path, text: str) -> ParameterTable | InputError:
    try:
        return _read(path, text)
    except InputError as error:
        return error


@given(start=st.integers(0, len(TEXT)), length=st.integers(0, 60), patch=st.text(max_size=20))
def test_any_damage_gives_weights_or_an_input_error(
    tmp_path_factory: pytest.TempPathFactory, start: int, length: int, patch: str
) -> None:
    path = tmp_path_factory.getbasetemp() / "damaged.toml"
    outcome = _outcome(path, TEXT[:start] + patch + TEXT[start + length :])
    if isinstance(outcome, InputError):
        assert outcome.remedy
        assert outcome.source == str(path)
    else:
        values = np.array(outcome.values_of(NAMES))
        assert np.all(np.isfinite(values) & (values > 0.0))
