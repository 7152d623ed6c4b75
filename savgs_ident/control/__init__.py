"""Control on the identified model: linear equivalents, H-infinity design, the loop closed on the nonlinear rig."""
