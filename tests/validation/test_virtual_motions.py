"""Dwells that are integrated side by side: each is what it is alone, and one that is lost takes no other with it."""

from collections.abc import Sequence

import numpy as np
import pytest

from savgs_ident.core.status import Status
from savgs_ident.core.values import Values
from savgs_ident.plants.quarter_car.catalogue import MODELS
from savgs_ident.plants.quarter_car.model import FREE
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.validation.foreign_draw import STEP
from savgs_ident.validation.virtual_motions import steady_dwells
from savgs_ident.validation.virtual_rig import Bench, Programme

from ..relaxed import with_kept_programs

HERTZ = (1.4, 2.35, 5.5)


@pytest.fixture(scope="module")
def bench(rig: Rig) -> Bench:
    return Bench(rig, MODELS["simtr"], FREE, Programme(HERTZ))


def _waves(bench: Bench, during: Sequence[Values], hertz: tuple[float, ...], step: float) -> np.ndarray:
    """Harmonics 0..9 of every dwell, (D, 2, 10)."""
    found = steady_dwells(bench.model(()), during, hertz, step)
    assert [each.status for each in found] == [Status.CONVERGED] * len(hertz)
    return np.stack([np.fft.rfft(each.readings)[:, :10] / 1024 for each in found])


@pytest.mark.slow
def test_each_dwell_is_what_it_is_alone_with_parameters_of_its_own(bench: Bench) -> None:
    """Friction, lift of the cam and angle of the link differ: each is that of its dwell."""
    given = (
        {},
        {"mu_r": 0.05, "cam_peak_to_peak": 0.02},
        {"mu_r": 0.02, "psi_nominal": 1.3},
    )
    during = [bench.values(each) for each in given]
    with with_kept_programs():
        together = _waves(bench, during, HERTZ, STEP)
        for place, (hertz, p) in enumerate(zip(HERTZ, during, strict=True)):
            (alone,) = _waves(bench, [p], (hertz,), STEP)
            size = np.abs(alone[:, 1:2])
            assert np.max(np.abs(together[place] - alone)[:, 1:] / size) < 5e-4
        plain = _waves(bench, [bench.values({})] * 3, HERTZ, STEP)
    changed = np.abs(together - plain)[..., 1] / np.abs(plain[..., 1])
    assert np.max(changed[0]) < 5e-4
    assert np.min(np.max(changed[1:], axis=1)) > 0.01


@pytest.mark.slow
def test_a_dwell_that_leaves_its_travel_is_the_only_one_that_is_lost(bench: Bench) -> None:
    during = [bench.values({}), bench.values({"cam_peak_to_peak": 3.0}), bench.values({})]
    with with_kept_programs():
        found = steady_dwells(bench.model(()), during, HERTZ)
    assert [each.status.ok for each in found] == [True, False, True]
    assert all(np.isfinite(each.readings).all() for each in found if each.status.ok)
