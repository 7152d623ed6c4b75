"""Read a campaign and print how long that took [s], imports apart: ``python -m benchmarks.read_whole FILE``."""

import sys
import time

from savgs_ident.recordings.read import read_campaign


def main() -> None:
    """Command line."""
    began = time.perf_counter()
    read_campaign(sys.argv[1])
    seconds = time.perf_counter() - began
    print(seconds)


if __name__ == "__main__":
    main()
