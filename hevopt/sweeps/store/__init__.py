"""Where results are kept: the store, its lock, how it is read, ranked and exported."""
