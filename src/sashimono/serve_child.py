"""The process of one job: the command line, which does not outlive the server nor take more memory than allowed.

python -m sashimono.serve_child PARENT MEMORY plan INPUT ...
"""

from __future__ import annotations

import os
import sys

_PR_SET_PDEATHSIG, _SIGKILL = 1, 9


def main() -> int:
    """Bind this process to its parent, then run the command line."""
    parent, memory, *arguments = sys.argv[1:]
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, _SIGKILL)
        if os.getppid() != int(parent):  # it is gone already
            return _SIGKILL
    if sys.platform != "win32" and int(memory) > 0:
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (int(memory), int(memory)))
    from sashimono.cli import run

    return run(arguments)


if __name__ == "__main__":
    sys.exit(main())
