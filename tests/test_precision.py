"""Double precision is what the package computes in, whatever the environment says about JAX."""

import os
import subprocess
import sys

import pytest


@pytest.mark.parametrize("stage", ["core.values", "core.transforms"])
def test_every_stage_on_jax_computes_in_double_precision(stage: str) -> None:
    code = f"import savgs_ident.{stage}, jax.numpy as jnp; print(jnp.zeros(()).dtype)"
    environment = {key: value for key, value in os.environ.items() if not key.startswith("JAX_")}
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "float64"
