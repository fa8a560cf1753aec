"""``python -m screwkin`` is the command ``screwkin``."""

from screwkin.cli import main

if __name__ == "__main__":
    main()
