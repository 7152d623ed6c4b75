"""Read a campaign and print how long that took [s], imports apart: ``python -m benchmarks.read_whole FILE``."""

import sys
import time

from savgs_ident.plants.quarter_car.rig_recordings import load_campaign


def main() -> None:
    """Command line."""
    began = time.perf_counter()
    load_campaign(sys.argv[1])
    seconds = time.perf_counter() - began
    print(seconds)


if __name__ == "__main__":
    main()
