"""`python -m lapwing` is the command `lapwing`."""

from lapwing.cli.entry_point import main

if __name__ == "__main__":
    main()
