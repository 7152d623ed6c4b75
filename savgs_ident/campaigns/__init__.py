"""Many campaigns: parameters and their trends."""
