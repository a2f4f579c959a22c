"""Pages that open offline from one file: what they show, and how it is drawn.

results.py      the saved form of a comparison: what a page is made from, and what it offers as a download
saved.py        reading that form from a file
collect.py      solved cases -> Results
energy.py, operation.py, maps.py    energy flows, modes and limits of a trajectory, maps of a car
verdict.py      the sentences at the top, and the alerts
comparison.py   Results -> page
page.py         what all pages share: templates, style, compressed data and scripts
"""
