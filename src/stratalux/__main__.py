"""``python -m stratalux``."""

from .cli import main

main()
