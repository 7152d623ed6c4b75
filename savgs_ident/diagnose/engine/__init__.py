"""The engine of a diagnosis: it knows a differentiable prediction, data with covariance and candidate terms only."""
