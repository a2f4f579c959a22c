"""The page of a folder of saved comparisons: side by side, and what changed from one to the next."""
