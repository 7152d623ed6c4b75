"""The posterior of the identified parameters: log density, samplers, convergence, what it says."""
