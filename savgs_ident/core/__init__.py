"""What every stage speaks: parameters with units, transforms and priors, files, results, statuses and errors."""
