"""What the peer ``harmonicbalance`` is given to solve is what the package solves."""

import jax.numpy as jnp
import numpy as np
import pytest

from benchmarks.by_harmonicbalance import compile_force
from benchmarks.task import make_task
from savgs_ident.simulate.periodic import PeriodicSettings, simulate_periodic


@pytest.mark.slow
@pytest.mark.parametrize("frequency", [2.35, 6.0])
def test_motions_of_the_package_leave_no_force(frequency: float) -> None:
    """On even nodes, where both march the bristle by the same rule; friction alone is a hundred newtons."""
    task = make_task((frequency,))
    even = PeriodicSettings(nodes=512, slow=0.1, adaptations=0)
    solution = simulate_periodic(task.model, task.values, task.excitation, even)
    assert all(status.ok for status in solution.status())
    x, y = solution.trajectory
    omega = jnp.asarray(2.0 * np.pi * frequency)
    force = compile_force(task)
    left = np.asarray(force((*x[:4], *y[:2]), omega))
    assert np.max(np.abs(left)) < 1e-3
    slower = np.asarray(force((*x[:2], *(0.99 * x[2:4]), *y[:2]), omega))
    assert np.max(np.abs(slower)) > 1.0
