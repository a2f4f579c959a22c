"""Logged drives to cycles of even steps."""
