"""IPOPT on a program, and how it ended."""

from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.status import Status
from savgs_ident.fit.collocation.program import Program, as_casadi

AMD = 0
"""The ordering of unknowns that MUMPS is to use: approximate minimum degree. It takes half the time of the one
that it would choose here, and loses less to rounding, which IPOPT would take for a wrong curvature."""

OBJECTIVE_UNIT = 1e4
"""The objective is given to IPOPT in these: so its slopes are of the order of those of the constraints."""

_OUTCOMES = {
    "Solve_Succeeded": Status.CONVERGED,
    "Maximum_Iterations_Exceeded": Status.MAX_ITERATIONS,
    "Invalid_Number_Detected": Status.NOT_FINITE,
}


class Solution(NamedTuple):
    """Scaled unknowns ``w`` [1], (n,), where IPOPT ended, the objective there [1], and its iterations."""

    w: NDArray[np.float64]
    objective: float
    status: Status
    iterations: int


def solve_program(
    program: Program, start: NDArray[np.float64], iterations: int, tolerance: float
) -> Solution:
    """IPOPT from scaled unknowns ``start`` [1], (n,), until constraints and scaled slopes are within ``tolerance``.

    Look at ``status`` of the solution: any end but the one asked for is a failure, and where IPOPT does not say
    more the problem counts as stalled.
    """
    solver = _solver(program, iterations, tolerance)
    found = solver(x0=start, lbg=0.0, ubg=0.0)
    w, said = np.array(found["x"]).ravel(), solver.stats()
    status = _OUTCOMES.get(said["return_status"], Status.STALLED)
    if not np.isfinite(w).all():
        status = Status.NOT_FINITE
    return Solution(w, float(found["f"]), status, int(said["iter_count"]))


def _solver(program: Program, iterations: int, tolerance: float) -> ca.Function:
    quadratic, size = program.quadratic, program.unknowns.size
    curvature = as_casadi(quadratic.curvature)
    w, nothing = ca.MX.sym("w", size), ca.MX.sym("nothing", 0)
    weight, prices = ca.MX.sym("weight"), ca.MX.sym("prices", program.constraints.size1_out(0))
    slope = ca.mtimes(curvature, w) - quadratic.slope
    value = 0.5 * ca.dot(w, slope - quadratic.slope) + quadratic.rest
    within = program.constraints(w)
    options: dict[str, Any] = {
        "grad_f": ca.Function("gradient", [w, nothing], [value, slope]),
        "jac_g": ca.Function("slopes", [w, nothing], [within, program.jacobian(w)]),
        "hess_lag": ca.Function("curvature", [w, nothing, weight, prices], [weight * ca.triu(curvature)]),
        "no_nlp_grad": True,
        "calc_lam_p": False,
        "show_eval_warnings": False,
        "print_time": False,
        "ipopt": {
            "max_iter": iterations,
            "tol": tolerance,
            "acceptable_iter": 0,
            "nlp_scaling_method": "none",
            "obj_scaling_factor": 1.0 / OBJECTIVE_UNIT,
            "hessian_constant": "yes",
            "mumps_pivot_order": AMD,
            "print_level": 0,
            "sb": "yes",
        },
    }
    return ca.nlpsol("crosscheck", "ipopt", {"x": w, "f": value, "g": within}, options)
