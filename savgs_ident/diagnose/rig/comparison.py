"""What a measured response is compared with: the plant that it drives, and the response as data."""

from collections.abc import Mapping

import numpy as np

from savgs_ident.core.rig import Rig
from savgs_ident.diagnose.engine.data import Data
from savgs_ident.diagnose.rig.plant import RigPlant
from savgs_ident.fit.target import harmonic_target
from savgs_ident.model.effect import AbstractEffect
from savgs_ident.posterior.likelihood import likelihood_of
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.simulate.measured import measured_excitation
from savgs_ident.simulate.periodic import PeriodicSettings


def rig_plant(
    measured: HarmonicResponse,
    rig: Rig,
    catalogue: Mapping[str, AbstractEffect],
    baseline: tuple[str, ...],
    free: tuple[str, ...],
    orders: int = 9,
    settings: PeriodicSettings | None = None,
) -> tuple[RigPlant, Data]:
    """The plant of a measured response, and the response as data.

    Raises :class:`InputError` for a response that cannot be used.
    """
    target = harmonic_target(measured, orders)
    likelihood = likelihood_of(target)
    excitation = measured_excitation(measured, rig.parameters["psi_nominal"].value)
    plant = RigPlant(
        rig=rig,
        catalogue=catalogue,
        baseline=baseline,
        free=free,
        excitation=excitation,
        likelihood=likelihood,
        shape=(int(target.used.shape[0]), int(target.used.shape[1]), int(target.used.shape[2])),
        settings=settings or PeriodicSettings(),
    )
    shape = target.used.shape
    dwell = np.repeat(np.arange(shape[0]), 2 * shape[1] * shape[2])[likelihood.place]
    data = Data(
        np.asarray(likelihood.measured), np.asarray(likelihood.variance), np.asarray(likelihood.reach), dwell
    )
    return plant, data
