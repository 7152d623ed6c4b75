"""The loop closed on the nonlinear rig: controller, instruments, drive with its limits, one integration."""
