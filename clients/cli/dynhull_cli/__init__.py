"""The command line: `dynhull`."""
