"""The published study done again, and what its differences from ours come from.

variations.py   other assumptions, applied to cars, cycle or problem
cases.py        the study as shipped and under each of them: figures
members.py      what every member of the rule families would have given
energies.py     where the energy goes
verdicts.py     what reaches a published figure, and what is left
sections.py     a table and a verdict for each difference
details.py      the tables beside the sections
page.py         the whole page, Markdown
"""
