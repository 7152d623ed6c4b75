"""The rig as one implicit residual, differentiable in every parameter.

Importing it turns on double precision in JAX: friction and hardpoints need it.
"""

import jax

jax.config.update("jax_enable_x64", True)
