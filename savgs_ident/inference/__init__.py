"""Parameters from data: priors, likelihood, maximum a posteriori, Laplace approximation, sampling."""
