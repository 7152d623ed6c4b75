"""Run a command and print its wall-clock time, peak memory, exit code and output as JSON (POSIX).

    python benchmarks/measure_process.py python -c "print('hello')"

To the system a process has used at least the memory of the one that started it, so this starter is a small
one: nothing but the standard library.
"""

import json
import os
import subprocess
import sys
import time


def main() -> None:
    """Command line: the command and its arguments."""
    began = time.perf_counter()
    process = subprocess.Popen(sys.argv[1:], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    output = process.stdout.read() if process.stdout is not None else ""
    _, status, usage = os.wait4(process.pid, 0)
    seconds = time.perf_counter() - began
    process.returncode = os.waitstatus_to_exitcode(status)
    per_mb = 1e6 if sys.platform == "darwin" else 1e6 / 1024.0
    print(json.dumps([seconds, usage.ru_maxrss / per_mb, process.returncode, output]))


if __name__ == "__main__":
    main()
