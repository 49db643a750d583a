"""The process that does the runs of one worker: `python -m diagrams.campaigns.child`.

Reads a job a line on its standard input and writes an answer a line on its standard
output; whatever else is printed goes to the standard error. It ends with its parent.
"""

import ctypes
import json
import os
import resource
import signal
import sys

from diagrams.campaigns.acts import answer, find_act

READY = "ready"
"""What it says once it can be asked."""
_DIE_WITH_PARENT = 1  # PR_SET_PDEATHSIG


def main() -> None:
    """Answers jobs until there are no more."""
    act, memory = sys.argv[1], int(float(sys.argv[2]))
    ctypes.CDLL(None).prctl(_DIE_WITH_PARENT, signal.SIGKILL)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # its parent decides
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    do = find_act(act)
    answers.write(READY + "\n")
    answers.flush()
    for line in sys.stdin:
        answers.write(json.dumps(answer(do, json.loads(line))) + "\n")
        answers.flush()


if __name__ == "__main__":
    main()
