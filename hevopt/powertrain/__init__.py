"""The backward evaluator: a car on a cycle to the table of every control at every step."""
