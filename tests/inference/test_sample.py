"""When sampling ends."""

import time
from dataclasses import replace

import pytest

from savgs_ident.core.errors import InputError
from savgs_ident.inference.diagnostics import R_HAT, least_ess, mixing_of
from savgs_ident.inference.expansion import Expansion
from savgs_ident.inference.sample import SAMPLERS, _run
from savgs_ident.inference.samplers.chains import SamplingSettings, new_checkpoint

from .toy import Toy
from .toy_surrogate import Stand

ONE_OF_THEM_SLOW = [pytest.param(each, marks=pytest.mark.slow if each == "nuts" else ()) for each in SAMPLERS]
"""What runs around both is the same; NUTS takes long to compile."""


@pytest.mark.slow
@pytest.mark.parametrize("name", SAMPLERS)
def test_it_goes_on_until_every_identified_parameter_is_known_well_enough(
    name: str, bent: Toy, rough: Stand
) -> None:
    lines: list[str] = []
    settings = SamplingSettings(name, target_ess=300.0, patience_s=0.0)
    chains = _run(
        Expansion(bent, rough.surrogate),
        settings,
        new_checkpoint(None, ""),
        time.perf_counter(),
        lines.append,
    )
    mixing = [mixing_of(chains.points[:, :, place]) for place in range(2)]
    assert least_ess(mixing) >= 300.0
    assert all(each.r_hat <= R_HAT for each in mixing)
    assert f"{len(chains.points)} steps" in lines[-1]
    assert f"{least_ess(mixing):.0f} of 300" in lines[-1]


@pytest.mark.parametrize("name", ONE_OF_THEM_SLOW)
def test_without_time_there_are_draws_all_the_same(name: str, bent: Toy, rough: Stand) -> None:
    settings = SamplingSettings(name, time_limit_s=0.0)
    chains = _run(
        Expansion(bent, rough.surrogate), settings, new_checkpoint(None, ""), time.perf_counter(), print
    )
    assert 0 < len(chains.points) <= 16


@pytest.mark.parametrize("name", ONE_OF_THEM_SLOW)
def test_a_model_that_is_solved_nowhere_is_an_error(name: str, bent: Toy, rough: Stand) -> None:
    nowhere = replace(bent, edge=-1e9)
    settings = SamplingSettings(name, time_limit_s=0.0)
    with pytest.raises(InputError, match="none of the points"):
        _run(
            Expansion(nowhere, rough.surrogate),
            settings,
            new_checkpoint(None, ""),
            time.perf_counter(),
            print,
        )
