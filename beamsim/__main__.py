"""``python -m beamsim``."""

from beamsim.cli import main

if __name__ == "__main__":
    main()
