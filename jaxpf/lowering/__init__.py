"""What is written for the compiler's sake, and nothing else."""
