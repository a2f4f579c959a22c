"""Who solves: pools of workers, the child process that solves a job, and its supervisor."""
