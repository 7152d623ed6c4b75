"""The result as ArviZ's inference data: groups posterior, posterior_predictive, sample_stats, observed_data.

Complex harmonics stand in it as real and imaginary parts. The file is netCDF, for any ArviZ to read.
"""

from pathlib import Path

import arviz_base
import numpy as np
import xarray as xr

from savgs_ident.core.files import scratch_folder, write_bytes
from savgs_ident.model.sensors import RESPONSE_CHANNELS
from savgs_ident.posterior.result import Posterior

_DIMENSIONS = ["dwell", "channel", "order"]


def inference_data(posterior: Posterior) -> xr.DataTree:
    """All groups; variables carry their units."""
    predictive, measured = posterior.predictive, posterior.measured
    orders = predictive.used.shape[2]
    rows = [measured.channel(name) if name in measured.channels else 0 for name in RESPONSE_CHANNELS]
    observed = np.where(predictive.used, measured.harmonics[:, rows, :orders], np.nan)
    replicated = np.where(predictive.used, predictive.replicated, np.nan)[None]
    model = predictive.model[None]
    tree = arviz_base.from_dict(
        {
            "posterior": dict(posterior.draws),
            "posterior_predictive": _parts("harmonics", replicated) | _parts("model", model),
            "sample_stats": dict(posterior.statistics),
            "observed_data": _parts("harmonics", observed),
        },
        dims={f"{name}_{part}": _DIMENSIONS for name in ("harmonics", "model") for part in ("re", "im")},
        coords={
            "dwell": list(measured.tests),
            "channel": list(RESPONSE_CHANNELS),
            "order": np.arange(orders),
        },
        # A run that was stopped early may have fewer draws than walkers.
        check_conventions=False,
    )
    for marginal in posterior.marginals:
        tree["posterior"][marginal.name].attrs.update(
            unit=marginal.unit, about=marginal.about, role=marginal.role
        )
    for group in ("posterior_predictive", "observed_data"):
        tree[group].coords["frequency"] = ("dwell", measured.frequency, {"unit": "Hz"})
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
