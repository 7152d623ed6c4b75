"""The design as a whole, and the controller as a file."""

import json
from dataclasses import replace
from pathlib import Path

import control
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from savgs_ident.control.design import (
    FACTORS,
    REGULARISATION,
    Design,
    DigitalController,
    controller_record,
    read_controller,
)
from savgs_ident.control.linear_equivalent import AlphaMap, TwoMasses
from savgs_ident.control.synthesis import PRECISION, RATE, Robustness, Synthesis, discretise
from savgs_ident.core.errors import InputError

from ..in_one_test import over
from .conftest import FEW_RIGS


def test_the_shipped_design_is_to_be_trusted(design: Design, masses: TwoMasses) -> None:
    assert design.trusted
    assert design.synthesis.holds
    assert design.margins.stable
    assert design.digital_margins.stable
    assert design.masses[1:] == masses[1:]
    assert design.digital.rate == pytest.approx(RATE)


def test_it_is_stable_on_every_rig_that_the_tolerances_allow(design: Design) -> None:
    assert len(design.robustness.margins) == len(design.rigs.values) == FEW_RIGS
    assert design.robustness.stable
    assert np.isfinite(design.robustness.peaks).all()
    # No rig but the nominal one was designed for: some does worse.
    assert max(design.robustness.peaks) > design.synthesis.peak


def test_no_evidence_may_be_missing(design: Design) -> None:
    unstable = replace(design.margins, stable=False)
    passed = replace(design.synthesis, peak=1.01 * design.synthesis.gamma)
    shaken = Robustness((*design.robustness.margins[1:], unstable), design.robustness.peaks)
    assert not replace(design, synthesis=passed).trusted
    assert not replace(design, margins=unstable).trusted
    assert not replace(design, digital_margins=unstable).trusted
    assert not replace(design, robustness=shaken).trusted


def test_every_regularising_weight_was_tried_at_every_factor(design: Design, synthesis: Synthesis) -> None:
    tried = [(each.weight, each.factor) for each in design.regularisation]
    assert tried == [(weight, factor) for weight in REGULARISATION for factor in FACTORS]
    unchanged = [each for each in design.regularisation if each.factor == 1.0]
    assert [each.gamma_least for each in unchanged] == [synthesis.gamma_least] * len(REGULARISATION)
    assert [each.phase_deg for each in unchanged] == [design.margins.phase_deg] * len(REGULARISATION)


def test_more_noise_never_lowers_the_least_gamma(design: Design) -> None:
    for weight in REGULARISATION:
        least = np.array([each.gamma_least for each in design.regularisation if each.weight == weight])
        assert np.all(np.diff(least) >= -PRECISION * least[:-1])


SMALL = DigitalController(
    control.ss([[0.9, 0.1], [0.0, 0.8]], np.ones((2, 3)), [[0.1, -1.0]], [[0.0, 2.0, 1e-3]], 1e-3),
    AlphaMap(jnp.asarray(np.pi / 2.0), jnp.asarray([-0.017, 0.001, 0.009])),
)
TEXT = json.dumps(controller_record(SMALL))


def _read(path: Path, text: str) -> DigitalController:
    path.write_text(text, encoding="utf-8")
    return read_controller(path)


def test_a_controller_comes_back_to_the_last_digit(synthesis: Synthesis, tmp_path: Path) -> None:
    written = DigitalController(discretise(synthesis.controller, 800.0), SMALL.alpha)
    found = _read(tmp_path / "controller.json", json.dumps(controller_record(written)))
    for name in "ABCD":
        assert np.array_equal(getattr(found.space, name), getattr(written.space, name))
    assert (found.space.dt, found.rate) == (written.space.dt, 800.0)
    assert found.space.input_labels == written.space.input_labels
    assert found.space.output_labels == written.space.output_labels
    assert np.array_equal(found.alpha.coefficients, written.alpha.coefficients)
    assert found.alpha.nominal == written.alpha.nominal


def test_the_law_in_the_file_is_the_controller(synthesis: Synthesis, tmp_path: Path) -> None:
    """Run as the file says, sample by sample, it answers as the transfer function does."""
    record = controller_record(DigitalController(discretise(synthesis.controller), SMALL.alpha))
    assert "x[k+1] = A x[k] + B y[k], u[k] = C x[k] + D y[k]" in str(record["law"])
    a, b, c, d = (np.array(record[name]) for name in "ABCD")
    rng = np.random.default_rng(3)
    seen = rng.standard_normal((3, 200))
    x, commands = np.zeros(a.shape[0]), []
    for y in seen.T:
        commands.append(c @ x + d @ y)
        x = a @ x + b @ y
    wanted = np.asarray(control.forced_response(discretise(synthesis.controller), inputs=seen).outputs)
    assert np.ravel(commands) == pytest.approx(np.ravel(wanted), abs=1e-9 * np.abs(wanted).max())


def _with(**changed: object) -> str:
    return json.dumps(json.loads(TEXT) | changed)


def _without(name: str) -> str:
    return json.dumps({key: value for key, value in json.loads(TEXT).items() if key != name})


ALPHA = json.loads(TEXT)["alpha_m_per_rad"]

FAULTS = {
    "empty": "",
    "a list": "[1, 2]",
    "a text": '"A"',
    "nothing": "null",
    "nested without end": "[" * 100_000,
    "another schema": _with(schema=2),
    "a truth for a schema": _with(schema=True),
    "no A": _without("A"),
    "no rate": _without("rate_hz"),
    "no alpha": _without("alpha_m_per_rad"),
    "A a number": _with(A=3.0),
    "A not square": _with(A=[[1.0, 2.0]]),
    "A ragged": _with(A=[[0.9, 0.1], [0.0]]),
    "A of texts": _with(A=[["0.9", "0.1"], ["0.0", "0.8"]]),
    "A of truths": _with(A=[[True, False], [False, True]]),
    "B too narrow": _with(B=[[1.0], [1.0]]),
    "C too long": _with(C=[[0.1, -1.0, 0.0]]),
    "D not finite": _with(D=[[float("nan"), 0.0, 0.0]]),
    "D huge": _with(D=[[10**400, 0.0, 0.0]]),
    "rate zero": _with(rate_hz=0.0),
    "rate negative": _with(rate_hz=-1000.0),
    "rate a truth": _with(rate_hz=True),
    "rate a text": _with(rate_hz="1000"),
    "rate infinite": _with(rate_hz=float("inf")),
    "rate huge": _with(rate_hz=10**400),
    "rate without a period": _with(rate_hz=5e-324),
    "alpha a number": _with(alpha_m_per_rad=-0.017),
    "alpha without powers": _with(alpha_m_per_rad={"nominal_angle_rad": 1.5}),
    "alpha with no power": _with(alpha_m_per_rad=ALPHA | {"powers_of_angle_from_nominal": []}),
    "alpha with a table": _with(alpha_m_per_rad=ALPHA | {"powers_of_angle_from_nominal": {"0": 1.0}}),
    "nominal angle a list": _with(alpha_m_per_rad=ALPHA | {"nominal_angle_rad": [1.5]}),
}


@over("fault", FAULTS)
def test_what_is_no_controller_is_refused_with_file_and_remedy(fault: str, tmp_path: Path) -> None:
    path = tmp_path / "controller.json"
    with pytest.raises(InputError) as caught:
        _read(path, FAULTS[fault])
    assert caught.value.source == str(path)
    assert "savgs-ident design" in caught.value.remedy


def test_what_is_no_readable_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read: No such file"):
        read_controller(tmp_path / "none.json")
    with pytest.raises(InputError, match="cannot be read: Is a directory"):
        read_controller(tmp_path)
    (tmp_path / "latin.json").write_bytes(TEXT.encode().replace(b"schema", b"sch\xe9ma"))
    with pytest.raises(InputError, match="not JSON"):
        read_controller(tmp_path / "latin.json")


def _is_whole(found: DigitalController) -> bool:
    space, alpha = found.space, found.alpha
    parts: list[NDArray[np.float64]] = [space.A, space.B, space.C, space.D, np.asarray(alpha.coefficients)]
    finite = all(np.isfinite(part).all() for part in parts) and np.isfinite(found.rate)
    return bool(finite and found.rate > 0.0 and (space.noutputs, space.ninputs) == (1, 3))


def _outcome(path: Path, text: str) -> DigitalController | InputError:
    try:
        return _read(path, text)
    except InputError as error:
        return error


def _survives(path: Path, text: str) -> None:
    outcome = _outcome(path, text)
    assert outcome.remedy if isinstance(outcome, InputError) else _is_whole(outcome)


@pytest.mark.slow
@given(start=st.integers(0, len(TEXT)), length=st.integers(0, 60), patch=st.text(max_size=20))
def test_any_damage_gives_a_controller_or_an_input_error(
    tmp_path_factory: pytest.TempPathFactory, start: int, length: int, patch: str
) -> None:
    path = tmp_path_factory.getbasetemp() / "damaged.json"
    text = TEXT[:start] + patch + TEXT[start + length :]
    _survives(path, text.encode(errors="replace").decode())


junk = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=8,
)


@pytest.mark.slow
@given(key=st.sampled_from(sorted(json.loads(TEXT))), inner=st.sampled_from([None, *ALPHA]), value=junk)
def test_anything_in_place_of_an_entry_gives_a_controller_or_an_input_error(
    tmp_path_factory: pytest.TempPathFactory, key: str, inner: str | None, value: object
) -> None:
    path = tmp_path_factory.getbasetemp() / "replaced.json"
    changed = {"alpha_m_per_rad": ALPHA | {inner: value}} if inner is not None else {key: value}
    _survives(path, _with(**changed))
