"""`tsdyn stress`: the gallery of hard cases, random scenes and calls, and the laws that judge every run.

Imports simulation and below; nothing imports it but the command. Begin with laws.py: what holds of any run, without a
reference solution. gallery.py, rods.py and squeezer.py build the hard cases; random_scenes.py and random_calls.py
draw others; campaign.py runs them and makes the report.
"""
