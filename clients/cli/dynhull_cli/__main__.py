"""Run the command line: python -m dynhull_cli."""

from .main import main

main()
