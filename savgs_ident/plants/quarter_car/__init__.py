"""The quarter-car rig: one implicit residual, differentiable in every parameter."""
