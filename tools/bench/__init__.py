"""What the project costs, measured beside named peers in the same run: `python -m tools.bench`."""
