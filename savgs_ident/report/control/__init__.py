"""Reports of the linear equivalent, of a controller design and of the closed loop."""
