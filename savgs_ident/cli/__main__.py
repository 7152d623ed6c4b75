"""``python -m savgs_ident.cli``: the program where it is not installed."""

from savgs_ident.cli.app import run

if __name__ == "__main__":
    run()
