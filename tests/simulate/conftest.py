"""The paper's models at their numbers, and compiled programs kept from one run of the tests to the next."""

from collections.abc import Iterator

import jax
import pytest
from jax.experimental.compilation_cache import compilation_cache

from savgs_ident.core.rig import Rig
from savgs_ident.effects.registry import MODELS, build_model, model_parameters
from savgs_ident.model.quarter_car import QuarterCar
from savgs_ident.model.values import Values, as_values
from savgs_ident.simulate.compilation import use_persistent_cache


@pytest.fixture(scope="package", autouse=True)
def _vectors_over_nodes() -> Iterator[None]:
    """Solvers spread (P,) over (m, P) everywhere; programs are kept from one run to the next.

    JAX looks for its cache at the first compilation of a process, which another test may have been.
    """
    use_persistent_cache()
    compilation_cache.reset_cache()
    with jax.numpy_rank_promotion("allow"):
        yield


@pytest.fixture(scope="package")
def numbers(rig: Rig) -> Values:
    """All parameters of the rig with friction, SI."""
    return as_values(model_parameters(rig, MODELS["simtr"]).as_dict())


@pytest.fixture(scope="package")
def friction(rig: Rig) -> QuarterCar:
    """SimTR."""
    return build_model(rig, MODELS["simtr"])


@pytest.fixture(scope="package")
def frictionless(rig: Rig) -> QuarterCar:
    """SimQC."""
    return build_model(rig, MODELS["simqc"])
