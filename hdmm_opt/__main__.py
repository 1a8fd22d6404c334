"""`python -m hdmm_opt` is `hdmm-opt`."""

from .cli import main

if __name__ == "__main__":
    main(prog_name="hdmm-opt")
