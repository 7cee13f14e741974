"""The process behind the command `impostor`: Ctrl-C is one line from its first import on."""

import io
import sys


def run() -> None:
    """The console script."""
    # Names of files may hold what the terminal's encoding has not, and need not be text at all.
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    try:
        from impostor.cli import main

        code = main()
    except KeyboardInterrupt:
        print("impostor: stopped", file=sys.stderr)
        code = 130
    sys.exit(code)


if __name__ == "__main__":
    run()
