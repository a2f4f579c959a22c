"""What others measured, in whatever shape their tools wrote it, to the data files of hevopt."""
