"""What is compiled ahead of a fit is what the fit asks for: else it would be compiled twice."""

import jax.numpy as jnp
import numpy as np

from savgs_ident.fit.least_squares import _rehearse
from savgs_ident.inference.background.imposed import impose, node_loads
from savgs_ident.inference.likelihood import likelihood_of
from savgs_ident.inference.problem import evaluate
from savgs_ident.simulate import program_cache
from savgs_ident.simulate.periodic import simulate_periodic

from .bench import Bench


def test_a_fit_asks_for_no_other_programs(bench: Bench, monkeypatch) -> None:
    task, done = bench.task, set()
    monkeypatch.setattr(program_cache, "_DONE", done)
    problem = task.problem
    _rehearse(task)
    rehearsed = set(done)
    assert len(rehearsed) >= 4
    u = problem.free.to_unconstrained(task.table.as_dict())
    p = problem.parameters(u)
    motion = simulate_periodic(problem.model, p, task.excitation, task.settings.periodic)
    found = evaluate(problem, u, problem.unpinned, motion)
    field = np.ones(motion.mesh.layout.total)
    asked = impose(
        problem.model,
        likelihood_of(problem.target),
        problem.orders,
        p,
        found.solution,
        [(problem.model.ports[0].name, field)],
    )
    node_loads(problem.model, p, found.solution)
    assert np.isfinite(asked).all()
    assert jnp.isfinite(found.at.jacobian).all()
    assert done == rehearsed
