"""Rigs to try a controller on: drawn as their covariance says, or read from a posterior."""

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from numpy.typing import NDArray

from savgs_ident.control.design import Rigs, rigs_from_covariance, rigs_from_posterior
from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import ParameterTable

from ..in_one_test import over

NAMES = ("m_s", "k_sd", "c_sd")
MANY = 40_000


def _provenance(covariance: NDArray[np.float64], names: tuple[str, ...] = NAMES) -> dict[str, object]:
    return {"covariance": {"names": list(names), "matrix": covariance.tolist()}}


def _matrix(rigs: Rigs, names: tuple[str, ...]) -> NDArray[np.float64]:
    return np.array([[each[name] for name in names] for each in rigs.values])


def _covariance() -> NDArray[np.float64]:
    deviation = np.array([1.6, 900.0, 30.0])
    correlation = np.array([[1.0, 0.8, -0.3], [0.8, 1.0, 0.1], [-0.3, 0.1, 1.0]])
    return correlation * np.outer(deviation, deviation)


def _within_five_deviations(
    drawn: NDArray[np.float64], centre: NDArray[np.float64], wanted: NDArray[np.float64]
) -> None:
    """Of what the mean and the covariance of MANY normal draws scatter by."""
    own = np.diag(wanted)
    assert np.all(np.abs(drawn.mean(axis=0) - centre) < 5.0 * np.sqrt(own / MANY))
    scatter = np.sqrt((np.outer(own, own) + wanted**2) / MANY)
    assert np.all(np.abs(np.cov(drawn.T) - wanted) < 5.0 * scatter)


def test_draws_of_an_identified_rig_have_its_covariance(table: ParameterTable) -> None:
    rigs = rigs_from_covariance(table, _provenance(_covariance()), MANY)
    _within_five_deviations(_matrix(rigs, NAMES), np.array(table.values_of(NAMES)), _covariance())
    untouched = {name: value for name, value in table.as_dict().items() if name not in NAMES}
    assert all(each.items() >= untouched.items() for each in rigs.values[:10])
    assert "covariance of the fit" in rigs.source


def test_draws_of_a_drawing_have_its_tolerances(table: ParameterTable) -> None:
    rigs = rigs_from_covariance(table, {}, MANY)
    tolerance = np.array([table[name].tolerance for name in NAMES[:2]])
    assert np.all(tolerance > 0.0)
    drawn = _matrix(rigs, NAMES[:2])
    _within_five_deviations(drawn, np.array(table.values_of(NAMES[:2])), np.diag(tolerance**2))
    assert "tolerances" in rigs.source


def test_draws_stay_within_the_bounds_of_their_parameters(table: ParameterTable) -> None:
    wide = np.diag([1e6, 1e12])
    drawn = _matrix(rigs_from_covariance(table, _provenance(wide, ("mu_r", "c_sd")), 200), ("mu_r", "c_sd"))
    for column, name in zip(drawn.T, ("mu_r", "c_sd"), strict=True):
        assert column.min() == table[name].lower
        assert column.max() <= table[name].upper


def test_the_same_rigs_are_drawn_every_time(table: ParameterTable) -> None:
    provenance = _provenance(_covariance())
    assert rigs_from_covariance(table, provenance, 5) == rigs_from_covariance(table, provenance, 5)


BAD_COVARIANCES: dict[str, object] = {
    "a number": 3.0,
    "no names": {"matrix": [[1.0]]},
    "no matrix": {"names": ["m_s"]},
    "an unknown name": {"names": ["m_s", "mass"], "matrix": [[1.0, 0.0], [0.0, 1.0]]},
    "a list for a name": {"names": [["m_s"]], "matrix": [[1.0]]},
    "a text for a name list": {"names": "m_s", "matrix": [[1.0]]},
    "a matrix too small": {"names": ["m_s", "m_u"], "matrix": [[1.0]]},
    "ragged": {"names": ["m_s", "m_u"], "matrix": [[1.0, 0.0], [0.0]]},
    "texts": {"names": ["m_s"], "matrix": [["one"]]},
    "not finite": {"names": ["m_s"], "matrix": [[float("nan")]]},
    "lopsided": {"names": ["m_s", "m_u"], "matrix": [[1.0, 0.5], [0.0, 1.0]]},
    "a negative variance": {"names": ["m_s", "m_u"], "matrix": [[1.0, 0.0], [0.0, -1.0]]},
    "a correlation above one": {"names": ["m_s", "m_u"], "matrix": [[1.0, 1.1], [1.1, 1.0]]},
}


@over("fault", BAD_COVARIANCES)
def test_what_is_no_covariance_is_refused(table: ParameterTable, fault: str) -> None:
    with pytest.raises(InputError, match="no covariance") as caught:
        rigs_from_covariance(table, {"covariance": BAD_COVARIANCES[fault]}, 5, "model.toml")
    assert caught.value.remedy
    assert caught.value.source == "model.toml"


def _posterior(path: Path, **draws: object) -> Path:
    with h5py.File(path, "w") as file:
        for name, values in draws.items():
            file.create_dataset(f"posterior/{name}", data=values)
    return path


def test_the_posterior_of_another_rig_is_refused_however_few_rigs_are_asked_for(
    table: ParameterTable, tmp_path: Path
) -> None:
    near = np.random.default_rng(0).normal(table["m_s"].value, 2.0, (4, 50))
    path = _posterior(tmp_path / "posterior.nc", m_s=near)
    assert len(rigs_from_posterior(table, path, 1).values) == 1
    for count in (1, 12):
        with pytest.raises(InputError, match="posterior of another rig: m_s"):
            rigs_from_posterior(table, _posterior(tmp_path / "other.nc", m_s=near + 14.0), count)


def test_rigs_of_a_posterior_are_its_draws_evenly_spread(table: ParameterTable, tmp_path: Path) -> None:
    """Chain by draw, one chain after the other; what is no parameter is left out."""
    rng = np.random.default_rng(5)
    draws = {name: table[name].value * rng.uniform(0.9, 1.1, (4, 25)) for name in NAMES}
    path = _posterior(tmp_path / "posterior.nc", **draws, chain=np.arange(4), draw=np.arange(25))
    rigs = rigs_from_posterior(table, path, 12)
    chosen = [0, 9, 18, 27, 36, 45, 54, 63, 72, 81, 90, 99]
    for name in NAMES:
        assert [each[name] for each in rigs.values] == draws[name].ravel()[chosen].tolist()
    assert [each["m_u"] for each in rigs.values] == [table["m_u"].value] * 12
    assert len(rigs_from_posterior(table, path, 1000).values) == 100


def _group_of(file: h5py.File) -> None:
    file.create_group("posterior/m_s")


def _prior(file: h5py.File) -> None:
    file.create_dataset("prior/m_s", data=np.ones((2, 3)))


def _no_group(file: h5py.File) -> None:
    file.create_dataset("posterior", data=np.ones((3, 3)))


def _broken_link(file: h5py.File) -> None:
    file.create_group("posterior")["m_s"] = h5py.SoftLink("/nowhere")


def _of(**draws: object) -> Callable[[h5py.File], None]:
    def write(file: h5py.File) -> None:
        for name, values in draws.items():
            file.create_dataset(f"posterior/{name}", data=values)

    return write


BAD_POSTERIORS: dict[str, Callable[[h5py.File], None]] = {
    "empty": lambda file: None,
    "a prior alone": _prior,
    "a posterior that is no group": _no_group,
    "a parameter that is a group": _group_of,
    "a broken link": _broken_link,
    "no parameter of the rig": _of(slope=np.ones((2, 3))),
    "no draws": _of(m_s=np.ones((0, 3))),
    "no shape": _of(m_s=h5py.Empty("f8")),
    "unequal lengths": _of(m_s=np.ones((2, 3)), m_u=np.ones((2, 4))),
    "a draw that is no number": _of(m_s=np.array([[320.0, np.nan]])),
    "texts": _of(m_s=np.array([b"320", b"321"])),
    "whole numbers": _of(m_s=np.array([320, 321])),
}


@over("fault", BAD_POSTERIORS)
def test_what_is_no_posterior_is_refused(table: ParameterTable, tmp_path: Path, fault: str) -> None:
    path = tmp_path / "posterior.nc"
    with h5py.File(path, "w") as file:
        BAD_POSTERIORS[fault](file)
    with pytest.raises(InputError) as caught:
        rigs_from_posterior(table, path, 5)
    assert caught.value.source == str(path)
    assert "posterior.nc" in caught.value.remedy


def test_what_is_no_file_of_draws_is_refused(table: ParameterTable, tmp_path: Path) -> None:
    whole = _posterior(tmp_path / "whole.nc", m_s=np.ones((4, 500))).read_bytes()
    (tmp_path / "cut.nc").write_bytes(whole[: len(whole) // 2])
    (tmp_path / "text.nc").write_text("m_s = 320")
    for name in ("cut.nc", "text.nc", "none.nc", "."):
        with pytest.raises(InputError, match="cannot be read"):
            rigs_from_posterior(table, tmp_path / name, 5)
