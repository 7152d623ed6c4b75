"""The blind trial: campaigns with a hidden effect, and how well the diagnosis finds it."""
