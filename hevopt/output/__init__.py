"""What is shown in a terminal and written to plain files."""
