"""How objects show themselves: in one line, in a notebook, in a plot."""
