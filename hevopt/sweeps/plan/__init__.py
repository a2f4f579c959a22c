"""What a sweep will solve: study file, parameters, constraints, designs, and what bounds prune."""
