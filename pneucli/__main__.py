"""``python -m pneucli``."""

from pneucli.cli import main

if __name__ == "__main__":
    main()
