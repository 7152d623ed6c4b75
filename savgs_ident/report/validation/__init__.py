"""Reports of blind trials, false alarms and calibration."""
