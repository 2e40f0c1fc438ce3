"""`python -m sim`: the same as the console script `fanet`."""

from fanet_mw.__main__ import main

if __name__ == "__main__":
    main()
