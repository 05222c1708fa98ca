"""Run the command line: ``python -m sashimono``."""

from sashimono.cli import main

if __name__ == "__main__":
    main()
