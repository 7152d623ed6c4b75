"""Ctrl-C while the model is asked by emcee: the sampler says nothing of its own about it."""

from types import SimpleNamespace
from typing import Any

import emcee
import numpy as np
import pytest

from savgs_ident.inference.samplers import emcee as emcee_sampler
from savgs_ident.inference.samplers.chains import new_checkpoint


def _interrupted(*_: Any) -> Any:
    raise KeyboardInterrupt


def test_an_interrupt_in_the_model_is_passed_on_in_silence(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    start = emcee.State(np.random.default_rng(1).standard_normal((emcee_sampler.WALKERS, 2)))
    monkeypatch.setattr(emcee_sampler, "_first_state", lambda *_: start)
    monkeypatch.setattr(emcee_sampler._Tally, "log_density", _interrupted)
    chains = emcee_sampler.sample_by_emcee(
        SimpleNamespace(), SimpleNamespace(centre=np.zeros(2)), 1, new_checkpoint(None, "case")
    )
    with pytest.raises(KeyboardInterrupt):
        next(chains)
    assert capsys.readouterr() == ("", "")
