"""What every stage speaks: parameters with units, the rig file, statuses and errors."""
