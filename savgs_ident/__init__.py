"""System identification and sim-to-real diagnosis for a quarter-car suspension rig.

The stages are sub-packages, one a folder, and imports run one way:
``cli > report > fit > simulate > effects > model > responses > recordings > core``.
"""

__version__ = "0.1.0"
