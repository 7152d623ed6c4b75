"""A one-axis electromechanical positioner as a second plant of the engine: rows are the force, in time."""
