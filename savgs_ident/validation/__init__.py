"""How far a diagnosis can be trusted: blind trials, false alarms, calibration."""
