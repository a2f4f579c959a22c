"""The commands of `hevopt`, by subject; cli.py puts them together."""
