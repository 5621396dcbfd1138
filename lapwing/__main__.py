"""`python -m lapwing` is the command `lapwing`."""

from lapwing.cli.start import main

if __name__ == "__main__":
    main()
