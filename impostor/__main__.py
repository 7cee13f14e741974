"""The process behind the command `impostor`: Ctrl-C is one line from its first import on."""

import sys


def run() -> None:
    """The console script."""
    try:
        from impostor.cli import main

        code = main()
    except KeyboardInterrupt:
        print("impostor: stopped", file=sys.stderr)
        code = 130
    sys.exit(code)


if __name__ == "__main__":
    run()
