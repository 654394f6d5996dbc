"""What it costs to start: the import, a list of scenarios and estimators, and the import of Gymnasium beside them.

``python -m tests.benchmarks.start`` prints, for each, the least processor time of several new processes, in turn. The
byte code of all modules must be there, so `PYTHONDONTWRITEBYTECODE` is taken out of their environment.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys

ROUNDS = 10
STARTS = {
    "python": ["-c", "pass"],
    "import numpy": ["-c", "import numpy"],
    "import gymnasium": ["-c", "import gymnasium"],
    "import pydantic.main, typer, rich.table": ["-c", "import pydantic.main, typer, rich.table"],
    "import simnav": ["-c", "import simnav"],
    "import simnav, gymnasium": ["-c", "import simnav, gymnasium"],
    "simnav list": ["-m", "simnav", "list"],
    "simnav list --json": ["-m", "simnav", "list", "--json"],
}


def cost(arguments):
    """Processor time of a new process [s]."""
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, *arguments], check=True, stdout=subprocess.DEVNULL, env=environment)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main():
    found = {what: [] for what in STARTS}
    for _ in range(ROUNDS):
        for what, arguments in STARTS.items():
            found[what].append(cost(arguments))
    for what, costs in found.items():
        print(f"{what:42}{min(costs):8.3f} s")


if __name__ == "__main__":
    main()
