"""The viewer, an interactive 3-D animation on one HTML page that works offline, and figures by matplotlib.

The viewer: begin with view.py. run_data.py resamples and encodes a run, symbols.py says what is drawn; the files in
page/ draw it by three.js, view.py by matplotlib, for GIFs.

Figures: curves.py draws histories, phase portraits and mode shapes into the caller's axes, or into new ones,
ensembles.py many runs. Axes are returned, and every label has its unit. matplotlib is imported on first use.

Imports observables and below.
"""
