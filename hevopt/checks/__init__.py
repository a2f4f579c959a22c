"""Every fault of every file at once: what `hevopt validate` does."""
