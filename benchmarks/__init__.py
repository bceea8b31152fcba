"""Speed, as a table of one row a task: `python -m benchmarks`."""
