"""``python -m eutree`` and the ``eutree`` command."""

import sys


def main() -> None:
    """Run the command line."""
    try:
        from eutree.cli.main import run
    except KeyboardInterrupt:  # while the command line itself was being imported
        sys.exit(130)
    sys.exit(run(sys.argv[1:]))


if __name__ == "__main__":
    main()
