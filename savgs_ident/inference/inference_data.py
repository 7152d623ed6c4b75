"""A posterior as ArviZ's inference data (netCDF): written whole, and read by any ArviZ.

Its groups are posterior, posterior_predictive, sample_stats and observed_data; complex harmonics stand in them as
real and imaginary parts.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from savgs_ident.core.files import scratch_folder, write_bytes
from savgs_ident.inference.result import HarmonicPosterior, MotionPosterior, Posterior

if TYPE_CHECKING:
    import xarray as xr

_DIMENSIONS = ["dwell", "channel", "order"]


def inference_data(posterior: Posterior) -> "xr.DataTree":
    """All groups; variables carry their units."""
    if isinstance(posterior, MotionPosterior):
        return _of_force(posterior)
    assert isinstance(posterior, HarmonicPosterior), posterior
    return _of_harmonics(posterior)


def _of_harmonics(posterior: HarmonicPosterior) -> "xr.DataTree":
    predictive, measured = posterior.predictive, posterior.measured
    orders = predictive.used.shape[2]
    channels = [each.name for each in posterior.model.channels]
    rows = [measured.channel(name) if name in measured.channels else 0 for name in channels]
    observed = np.where(predictive.used, measured.harmonics[:, rows, :orders], np.nan)
    replicated = np.where(predictive.used, predictive.replicated, np.nan)[None]
    tree = _tree(
        posterior,
        _parts("harmonics", replicated) | _parts("model", predictive.model[None]),
        _parts("harmonics", observed),
        {f"{name}_{part}": _DIMENSIONS for name in ("harmonics", "model") for part in ("re", "im")},
        {"dwell": list(measured.tests), "channel": channels, "order": np.arange(orders)},
    )
    for group in ("posterior_predictive", "observed_data"):
        tree[group].coords["frequency"] = ("dwell", measured.frequency, {"unit": "Hz"})
        tree[group].coords["spacing"] = ("dwell", measured.spacing, {"unit": "Hz"})
    return tree


def _of_force(posterior: MotionPosterior) -> "xr.DataTree":
    predictive = posterior.predictive
    tree = _tree(
        posterior,
        {"force": predictive.replicated[None], "model": predictive.model[None]},
        {"force": posterior.measured},
        {"force": ["row"], "model": ["row"]},
        {"row": np.arange(posterior.measured.size)},
    )
    for group in ("posterior_predictive", "observed_data"):
        tree[group].coords["time"] = ("row", posterior.motion.row_times, {"unit": "s"})
        tree[group]["force"].attrs["unit"] = posterior.model.plant.inputs[0].unit
    return tree


def _tree(
    posterior: Posterior,
    predicted: dict[str, np.ndarray],
    observed: dict[str, np.ndarray],
    dimensions: dict[str, Sequence[str]],
    coordinates: dict[str, Any],
) -> "xr.DataTree":
    # Only here: ArviZ and what it brings along take seconds to load.
    import arviz_base

    tree = arviz_base.from_dict(
        {
            "posterior": dict(posterior.draws),
            "posterior_predictive": predicted,
            "sample_stats": dict(posterior.statistics),
            "observed_data": observed,
        },
        dims=dimensions,
        coords=coordinates,
        # A run that was stopped early may have fewer draws than walkers.
        check_conventions=False,
    )
    for marginal in posterior.marginals:
        tree["posterior"][marginal.name].attrs.update(
            unit=marginal.unit, about=marginal.about, role=marginal.role
        )
    tree.attrs["sampler"] = posterior.sampler
    return tree


def write_inference_data(posterior: Posterior, path: Path) -> Path:
    """Write the inference data, whole or not at all; raises :class:`InputError` if it cannot be written."""
    with scratch_folder() as folder:
        file = folder / "posterior.nc"
        inference_data(posterior).to_netcdf(file, engine="h5netcdf")
        return write_bytes(path, file.read_bytes())


def _parts(name: str, values: np.ndarray) -> dict[str, np.ndarray]:
    return {f"{name}_re": np.real(values), f"{name}_im": np.imag(values)}
