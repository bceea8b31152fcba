"""``python -m beamsim``."""

from beamsim.cli import program

if __name__ == "__main__":
    program()
