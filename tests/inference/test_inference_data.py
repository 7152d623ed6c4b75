"""The netCDF file: groups, dimensions and units, and every number as it was."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from savgs_ident.core.errors import InputError
from savgs_ident.inference.diagnostics import assess_convergence, mixing_of
from savgs_ident.inference.harmonic_question import predict
from savgs_ident.inference.inference_data import inference_data, write_inference_data
from savgs_ident.inference.likelihood import values_of
from savgs_ident.inference.result import HarmonicPosterior, Marginal
from savgs_ident.inference.samplers.chains import Chains
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.plants.quarter_car.rig import Rig

from .toy import FREE, straight_toy

DWELLS, DRAWS = 3, 40


@pytest.fixture(scope="module")
def posterior(rig: Rig) -> HarmonicPosterior:
    toy = straight_toy(dwells=DWELLS)
    random = np.random.default_rng(1)
    points = 0.1 * random.standard_normal((DRAWS, 4, 5))
    logs, accepted = random.standard_normal((DRAWS, 4)), random.random((DRAWS, 4)) < 0.7
    chains = Chains(points, logs, accepted, np.zeros(0), 0, DRAWS * 4, 0)
    values = values_of(FREE, toy.likelihood.scales, points)
    roles = {"friction": "identified", "damping": "identified"}
    units = {"friction": "1", "damping": "N s/m", "spring": "N/m"}
    marginals = tuple(
        Marginal(
            name, units.get(name, "1"), f"about {name}", roles.get(name, "nuisance"), *[0.0] * 4, (0.0, 1.0),
            *[0.0] * 7,
        )
        for name in values
    )  # fmt: skip
    return HarmonicPosterior(
        model=RigModel(rig),
        sampler="nuts",
        marginals=marginals,
        draws={name: each.T for name, each in values.items()},
        statistics={"lp": logs.T, "accepted": accepted.T.astype(float)},
        convergence=assess_convergence(chains, [mixing_of(values["friction"])], [], 1000.0, ()),
        predictive=predict(toy, chains, 20, 1),
        measured=toy.measured,
        sentences=(),
        wall_s=1.0,
    )


def test_groups_dimensions_and_units(posterior: HarmonicPosterior) -> None:
    tree = inference_data(posterior)
    assert set(tree.children) == {"posterior", "posterior_predictive", "sample_stats", "observed_data"}
    for name, draws in posterior.draws.items():
        variable = tree["posterior"][name]
        assert variable.dims == ("chain", "draw")
        np.testing.assert_array_equal(variable.values, draws)
        assert variable.attrs["unit"] == posterior.by_name[name].unit
        assert variable.attrs["role"] == posterior.by_name[name].role
        assert variable.attrs["about"] == f"about {name}"
    assert tree["posterior_predictive"]["model_re"].dims == ("chain", "draw", "dwell", "channel", "order")
    observed = tree["observed_data"]["harmonics_im"]
    assert observed.dims == ("dwell", "channel", "order")
    assert list(observed.coords["dwell"].values) == ["dwell 0", "dwell 1", "dwell 2"]
    assert list(observed.coords["channel"].values) == ["sprung_accel", "susp_deflection"]
    np.testing.assert_array_equal(observed.coords["frequency"], posterior.measured.frequency)
    assert observed.coords["frequency"].attrs["unit"] == "Hz"


def test_complex_parts_are_those_of_the_harmonics(posterior: HarmonicPosterior) -> None:
    tree = inference_data(posterior)
    predictive, used = posterior.predictive, posterior.predictive.used
    group = tree["posterior_predictive"]
    model = group["model_re"].values + 1j * group["model_im"].values
    np.testing.assert_array_equal(model[0], predictive.model)
    replicated = group["harmonics_re"].values + 1j * group["harmonics_im"].values
    np.testing.assert_array_equal(replicated[0][:, used], predictive.replicated[:, used])
    assert np.isnan(replicated[0][:, ~used]).all()
    observed = tree["observed_data"]
    seen = observed["harmonics_re"].values + 1j * observed["harmonics_im"].values
    # The toy's road comes first among its channels.
    np.testing.assert_array_equal(seen[used], posterior.measured.harmonics[:, 1:][used])
    assert np.isnan(seen[~used]).all()


def test_the_file_is_read_back_as_it_was(posterior: HarmonicPosterior, tmp_path: Path) -> None:
    path = write_inference_data(posterior, tmp_path / "posterior.nc")
    assert list(tmp_path.iterdir()) == [path]
    with xr.open_datatree(path, engine="h5netcdf") as read:
        read.load()
        original = inference_data(posterior)
        assert set(read.children) == set(original.children)
        for group in original.children:
            xr.testing.assert_equal(read[group].to_dataset(), original[group].to_dataset())
        assert read["posterior"]["damping"].attrs["unit"] == "N s/m"
        assert read.attrs["sampler"] == "nuts"


def test_a_place_that_cannot_be_written_is_said(posterior: HarmonicPosterior, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be written"):
        write_inference_data(posterior, tmp_path / "no such folder" / "posterior.nc")
