"""The quarter-car rig as a plant of the engine."""
