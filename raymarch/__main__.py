"""`python -m raymarch` is the command `raymarch`."""

from raymarch.cli import main

if __name__ == "__main__":
    main()
