"""Speed beside peers: `python -m benchmarks`, or `make bench`. One file for the work of each row."""
