"""The machine and its processes: threads, workers, ranks, checkpoints."""
