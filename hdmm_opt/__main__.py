"""The program: `hdmm-opt`, and `python -m hdmm_opt`."""

import signal
from types import FrameType

#: Code that may drop an interrupt or make another error of it: Python's imports, and CasADi.
DEAF = ("<frozen importlib._bootstrap>", "casadi/casadi.py")
#: How long an interrupt that came there waits, s.
PAUSE = 0.05


def _interrupt(number: int, frame: FrameType | None) -> None:
    """Raise KeyboardInterrupt; inside code that may drop it, the signal comes again later."""
    while frame is not None:
        if frame.f_code.co_filename.endswith(DEAF):
            signal.setitimer(signal.ITIMER_REAL, PAUSE)
            return
        frame = frame.f_back
    raise KeyboardInterrupt


def main() -> None:
    """Run the verb that the command line names."""
    if hasattr(signal, "SIGALRM") and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGALRM, _interrupt)
        signal.signal(signal.SIGINT, _interrupt)
    from .cli import main

    main(prog_name="hdmm-opt")


if __name__ == "__main__":
    main()
