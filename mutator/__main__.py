"""`python -m mutator` is `mutator`."""

from mutator.cli.app import main

if __name__ == "__main__":
    raise SystemExit(main())
