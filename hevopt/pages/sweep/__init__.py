"""The page of a sweep, made from its store."""
