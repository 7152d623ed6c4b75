"""The cross-check of the fit: the same parameters by another route, from the samples themselves.

The fit goes through harmonics, a trapezoidal rule in time and Gauss-Newton steps in JAX. Here the motions of all
dwells and the parameters are unknowns of one large optimisation: the samples are to be met, the model's
equations (translated to CasADi) hold at the points of a Radau rule, and IPOPT solves it. What the two routes share is
the model, the recordings and the frequencies; what they find should differ by less than its uncertainty.
"""
